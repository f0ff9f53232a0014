import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { Fusion } from '../protocol/messages';
import { FusionRefusal } from '../fusion/fusion_refusal';
import { BUSY, RpcError } from '../transport/connection';
import { Fusing, LONGEST_PAUSE_MS } from './fusing';
import { Store } from './store.svelte';

const MODULE = fileURLToPath(new URL('../../../build/wasm/bin/fusion.wasm', import.meta.url));
const FUSION: Fusion = {
  method: 'thermal_visible_blend',
  params: { alpha: 0.4 },
  params_in_force: { alpha: 0.4 },
  palette: 'iron',
  range: { mode: 'auto', min: 10, max: 30 },
  missing: 'visible',
};
const FACTS = {
  finite_count: 100,
  missing_count: 0,
  over_range_count: 0,
  under_range_count: 0,
  min: 10,
  max: 30,
  mean: 20,
  sigma: 5,
};

const later = () => new Promise<void>((resolve) => setTimeout(resolve, 5));

/** A session with a picture that is complete, on a robot that gives raw layers. */
function setUp({
  capabilities = ['raw_layers'],
  load,
  answer = () => Promise.resolve({}),
  isDrawerQuick = true,
}: {
  capabilities?: string[];
  load?: () => Promise<WebAssembly.Module>;
  /** What the robot says other than usual, or rejects with. */
  answer?: (params: { bins?: number }) => Promise<object>;
  isDrawerQuick?: boolean;
} = {}) {
  const store = new Store();
  store.link = { phase: 'open' };
  store.scene = { name: 'a', temperature: { min: 10, max: 700 }, live: false } as never;
  store.complete = {} as never;
  store.methods = [
    { id: 'thermal_visible_blend', label: 'Blend', params: [{ name: 'alpha', kind: 'number' }] },
    { id: 'colour_mapped_threshold', label: 'Threshold', params: [{ name: 'threshold', kind: 'temperature' }] },
    { id: 'thermal_change', label: 'Change', compares_with_baseline: true, params: [] },
  ] as never;
  store.pictureStands = true;
  store.fusionInForce = FUSION;
  store.stats = { throughput_bytes_per_s: 1e6 } as never;
  store.costs = { raw_bytes: 2000, change_bytes: 2000 };
  const counts = { drawn: 2, raw: 0, step_celsius: 0.01, waiting: 0 };
  const diary: string[] = [];
  const asked: object[] = [];
  const busy = { settings: false, answered: 0 };
  const picture = {
    startFusing: () => {
      diary.push('module');
      if (isDrawerQuick) fusing.drawerIsReady();
    },
    setFacts: () => diary.push('facts'),
    fuse: (settings: object | null) => diary.push(settings === null ? 'fuse nothing' : 'fuse'),
  };
  const fusing: Fusing = new Fusing(
    store,
    { rawCounts: () => counts, setHere: (isHere) => diary.push(isHere ? 'here' : 'not here') },
    picture as never,
    {
      request: async (method, params: { bins?: number; hues?: boolean }) => {
        asked.push({ method, ...params });
        const { bins, hues } = params;
        return {
          ...FACTS,
          ...(bins === undefined ? {} : { counts: new Array<number>(bins).fill(1) }),
          ...(hues === true ? { hues: new Array<number>(36).fill(1) } : {}),
          ...(await answer(params)),
        };
      },
      resubscribe: () => diary.push(`subscribe ${fusing.channels.join('+')}`),
      isBusy: () => busy.settings,
      answeredGeneration: () => busy.answered,
      isTakenIn: () => true,
      onShown: (method) => diary.push(`shown ${method}`),
      onBehind: () => diary.push('behind'),
      onHighlighted: () => undefined,
      onLeft: () => diary.push(`left to ${store.fusingPlace}`),
    },
    load ?? (() => WebAssembly.compile(readFileSync(MODULE))),
    true,
  );
  fusing.greeted(capabilities);
  return { store, fusing, counts, diary, asked, busy };
}

beforeEach(() => {
  vi.stubGlobal('navigator', { hardwareConcurrency: 4 });
});

describe.skipIf(!existsSync(MODULE))('Fusing, with the library', () => {
  async function here(options: Parameters<typeof setUp>[0] = {}) {
    const all = setUp(options);
    all.fusing.consider();
    await vi.waitFor(() => expect(all.diary).toContain('facts'));
    all.counts.raw = 2;
    all.fusing.consider();
    expect(all.store.fusingPlace).toBe('here');
    return all;
  }

  it('gets raw layers beside the picture, and is here when every drawn tile has them', async () => {
    const { store, fusing, counts, diary, asked } = setUp();
    expect(fusing.channels).toEqual(['fused']);
    fusing.consider();
    expect(store.fusingPlace).toBe('coming');
    expect(diary).toEqual(['subscribe fused+temperature+visible']);
    await vi.waitFor(() => expect(diary).toContain('facts'));
    expect(asked).toEqual([{ method: 'fusion.facts', bins: 4096, hues: true }]);
    counts.raw = 1;
    fusing.consider();
    expect(store.fusingPlace).toBe('coming');
    expect(store.rawShare).toBe(0.5);
    expect(fusing.apply(FUSION)).toBeNull();
    counts.raw = 2;
    fusing.consider();
    expect(store.fusingPlace).toBe('here');
    expect(diary.slice(-4)).toEqual(['fuse', 'here', 'shown thermal_visible_blend', 'subscribe temperature+visible']);
  });

  it('stays when it is wanted again before the robot has brought its colours, and leaves for good when it is not', async () => {
    const { store, fusing, counts, diary, asked } = await here();
    const before = asked.length;
    for (let i = 0; i < 2; i += 1) {
      fusing.setWish('robot');
      expect(diary.at(-1)).toBe('subscribe fused');
      fusing.setWish('here');
      expect(diary.slice(-4)).toEqual(['fuse', 'here', 'shown thermal_visible_blend', 'subscribe temperature+visible']);
      fusing.completed(0);
      expect(store.fusingPlace).toBe('here');
    }
    expect(asked).toHaveLength(before);
    // Not where something has come without raw layers meanwhile.
    fusing.setWish('robot');
    counts.drawn = 3;
    fusing.setWish('here');
    expect([diary.at(-1), store.fusingPlace]).toEqual(['subscribe fused', 'here']);
    fusing.setWish('robot');
    fusing.completed(0);
    expect([diary.slice(-3), store.fusingPlace]).toEqual([['not here', 'fuse nothing', 'left to robot'], 'robot']);
  });

  it('stays when the next setting can be made here, as long as the robot is not wanted', async () => {
    const { store, fusing, diary } = await here();
    const robots = { ...FUSION, method: 'thermal_change', params: {} };
    expect(fusing.apply(robots)).toBeNull();
    expect(diary.at(-1)).toBe('subscribe fused');
    expect(fusing.apply(FUSION)).not.toBeNull();
    expect(diary.slice(-3)).toEqual(['here', 'subscribe temperature+visible', 'shown thermal_visible_blend']);
    fusing.completed(0);
    expect(store.fusingPlace).toBe('here');
    fusing.setWish('robot');
    expect(fusing.apply(FUSION)).not.toBeNull();
    expect(fusing.channels).toEqual(['fused']);
  });

  it('does not leave before the robot has brought what is set now', async () => {
    const { store, fusing, busy } = await here();
    fusing.setWish('robot');
    busy.answered = 4;
    // A map that changes is ahead of what has come of it.
    store.generation = 9;
    fusing.completed(3);
    expect(store.fusingPlace).toBe('here');
    fusing.completed(4);
    expect(store.fusingPlace).toBe('robot');
  });

  it('decides at once on a new connection whether it stays', async () => {
    const { store, fusing, diary } = await here();
    fusing.setWish('robot');
    store.link = { phase: 'lost' } as never;
    fusing.setWish('here');
    store.link = { phase: 'open' };
    fusing.greeted(['raw_layers']);
    expect([store.fusingPlace, fusing.channels]).toEqual(['here', ['temperature', 'visible']]);
    store.link = { phase: 'lost' } as never;
    store.wanted = { method: 'thermal_change' };
    store.link = { phase: 'open' };
    fusing.greeted(['raw_layers']);
    expect([store.fusingPlace, fusing.channels]).toEqual(['here', ['fused']]);
    store.link = { phase: 'lost' } as never;
    store.link = { phase: 'open' };
    fusing.greeted([]);
    expect([store.fusingPlace, fusing.channels]).toEqual(['robot', ['fused']]);
    expect(diary).toContain('fuse nothing');
  });

  it('gives the library each of the settings once, however often it is looked at', async () => {
    const { FusionModule } = await import('../fusion/fusion_module');
    const { store, fusing } = await here();
    const change = vi.spyOn(FusionModule.prototype, 'change');
    const wanted = { ...FUSION, params: { alpha: 0.7 } };
    const inForce = fusing.apply(wanted);
    expect(change).toHaveBeenCalledTimes(1);
    store.fusionInForce = inForce;
    for (let i = 0; i < 10; i += 1) expect([fusing.leftToRobot, fusing.consider()]).toEqual([null, undefined]);
    expect(change).toHaveBeenCalledTimes(2);
    change.mockRestore();
  });

  it('makes plans as the robot does', async () => {
    const { fusing } = await here();
    const wanted = { ...FUSION, method: 'histogram_distribution', params: { k: 2, alpha: 1, invert: false } };
    const inForce = fusing.apply({ ...wanted, range: { mode: 'percentile', min: 0, max: 0, low: 10, high: 90 } });
    expect(inForce?.params_in_force).toEqual({ k: 2, alpha: 1, invert: false });
    expect(inForce?.range).toMatchObject({ mode: 'percentile', low: 10, high: 90 });
    expect(inForce?.range.min).toBeCloseTo(12, 2);
    expect(inForce?.range.max).toBeCloseTo(28, 2);
    expect(() => fusing.apply({ ...FUSION, params: { alpha: 7 } })).toThrow('alpha must be');
  });

  it('asks for facts that a plan lacks, and leaves that setting to the robot meanwhile', async () => {
    const { fusing, asked } = await here();
    const wanted = {
      ...FUSION,
      method: 'histogram_bin',
      params: { bins: 17, n: null, alpha: 1, invert: false, ties: 'index' },
    };
    expect(fusing.apply(wanted)).toBeNull();
    expect(asked.at(-1)).toEqual({ method: 'fusion.facts', bins: 17 });
    await later();
    expect(fusing.apply(wanted)?.params_in_force['n']).toEqual(expect.any(Number));
  });

  it('leaves a range to the robot for which temperatures come in too coarse steps, and says so', async () => {
    const { store, fusing, counts, diary } = setUp();
    fusing.consider();
    await vi.waitFor(() => expect(diary).toContain('facts'));
    // A 65,000th of what a tile spans where somebody has written 65535 for nothing.
    counts.step_celsius = 1;
    counts.raw = 2;
    fusing.consider();
    expect(store.fusingPlace).toBe('robot');
    expect(fusing.leftToRobot).toContain('steps of 1 °C');
    expect(fusing.channels).toEqual(['fused']);
    // When what stood out is gone, it is tried again.
    store.scene = { name: 'a', temperature: { min: 10, max: 30 }, live: false } as never;
    expect(fusing.channels).toEqual(['fused']);
    counts.step_celsius = 0.01;
    fusing.consider();
    expect(fusing.channels).toContain('temperature');
    counts.step_celsius = 1;
    fusing.consider();
    expect(store.fusingPlace).toBe('robot');
    // A range that is wide enough for them may be made here.
    store.fusionInForce = { ...FUSION, range: { mode: 'manual', min: 0, max: 600 } };
    fusing.consider();
    await later();
    fusing.consider();
    expect(store.fusingPlace).toBe('here');
    expect(fusing.apply({ ...FUSION, range: { mode: 'manual', min: 12, max: 15 } })).toBeNull();
    expect(fusing.channels).toContain('fused');
  });

  it('leaves thresholds to the robot where temperatures come in coarse steps, however wide the range is', async () => {
    const { store, fusing, counts } = setUp();
    store.fusionInForce = { ...FUSION, range: { mode: 'auto', min: 10, max: 1e30 } };
    fusing.consider();
    await later();
    Object.assign(counts, { raw: 2, step_celsius: 1.5e25 });
    fusing.consider();
    expect(fusing.leftToRobot).toBeNull();
    store.fusionInForce = { ...store.fusionInForce, method: 'colour_mapped_threshold', params: { threshold: 21.5 } };
    fusing.consider();
    expect(fusing.leftToRobot).toContain('too coarse for a threshold');
    expect(fusing.channels).toEqual(['fused']);
    counts.step_celsius = Math.fround(0.01);
    store.scene = { name: 'a', temperature: { min: 10, max: 30 }, live: false } as never;
    fusing.consider();
    fusing.consider();
    expect(fusing.leftToRobot).toBeNull();
  });

  it('asks for finer temperatures where the range is narrow, stays here meanwhile, and leaves what they cannot show to the robot', async () => {
    const { store, fusing, counts, diary } = await here();
    const set = (min: number, max: number) => {
      diary.length = 0;
      store.fusionInForce = { ...FUSION, range: { mode: 'manual', min, max } };
      fusing.consider();
      expect(store.fusingPlace).toBe('here');
      return diary.join();
    };
    expect([set(10, 12.56), fusing.step_celsius]).toEqual(['', undefined]);
    expect([set(10, 12.5), fusing.step_celsius]).toEqual(['subscribe temperature+visible', 0.002]);
    // As long as finer ones are on their way.
    counts.step_celsius = 0;
    // Not for every step of a slider, and never coarser again: that would be sent anew.
    expect([set(10, 11), set(10, 30), fusing.step_celsius]).toEqual(['', '', 0.002]);
    expect([set(10, 10.5), fusing.step_celsius]).toEqual(['subscribe temperature+visible', 1 / 5000]);
    expect([set(10, 10), fusing.step_celsius]).toEqual(['', 1 / 5000]);
    counts.step_celsius = Math.fround(0.00046);
    expect([set(10, 10.2), fusing.leftToRobot]).toEqual(['', null]);
    set(10, 10.1);
    expect(fusing.leftToRobot).toContain('steps of 0.00046 °C');
    expect(diary.join()).toBe('subscribe fused');
    fusing.sceneGone();
    expect(fusing.step_celsius).toBeUndefined();
  });

  it('does not try again on a map whose temperatures move while what stands out stays, and does in another scene', async () => {
    const { store, fusing, counts, diary } = setUp();
    fusing.setWish('here');
    const mapped = (name: string, min: number, max: number) => {
      store.scene = { name, temperature: { min, max }, live: true } as never;
      fusing.consider();
      fusing.consider();
    };
    mapped('a', 10, 65535);
    await vi.waitFor(() => expect(diary).toContain('facts'));
    Object.assign(counts, { raw: 2, step_celsius: 1 });
    mapped('a', 10, 65535);
    expect(fusing.channels).toEqual(['fused']);
    const before = diary.length;
    for (let i = 0; i < 10; i += 1) mapped('a', 10 + (i % 3) / 10, 65535 - (i % 4));
    mapped('a', 10, 70000);
    mapped('a', 10, 65535);
    expect(diary.slice(before)).toEqual([]);
    mapped('b', 10, 65535);
    expect(diary[before]).toBe('subscribe fused+temperature+visible');
  });

  it('makes colours here when the link is lost and all layers are there, whoever made them before', async () => {
    const { store, fusing, counts, diary } = await here();
    store.fusionInForce = { ...FUSION, method: 'thermal_change' };
    fusing.consider();
    fusing.completed(0);
    expect(store.fusingPlace).toBe('robot');
    expect(fusing.apply(FUSION)).toBeNull();
    store.link = { phase: 'lost' } as never;
    expect(fusing.apply({ ...FUSION, method: 'thermal_change' })).toBeNull();
    counts.raw = 1;
    expect(fusing.apply(FUSION)).toBeNull();
    counts.raw = 2;
    expect(fusing.apply(FUSION)).toMatchObject({ method: FUSION.method });
    expect(store.fusingPlace).toBe('here');
    expect(diary.slice(-3)).toEqual(['fuse', 'here', 'shown thermal_visible_blend']);
    // The next connection goes on with it.
    fusing.greeted(['raw_layers']);
    expect(fusing.channels).toEqual(['temperature', 'visible']);
  });

  it('begins anew with the robot after a connection without a scene, and asks nothing of that', async () => {
    const { store, fusing, diary, asked } = await here();
    const { scene } = store;
    asked.length = 0;
    store.scene = null;
    store.fusingProblem = 'a tile of the other scene';
    fusing.sceneGone();
    fusing.greeted(['raw_layers']);
    await later();
    expect(asked).toEqual([]);
    expect([store.fusingPlace, store.fusingProblem, fusing.channels]).toEqual(['robot', null, ['fused']]);
    expect(diary.slice(-4)).toEqual(['not here', 'fuse nothing', 'left to robot', 'subscribe fused']);
    store.scene = scene;
    fusing.consider();
    await vi.waitFor(() => expect(asked).toContainEqual({ method: 'fusion.facts', bins: 4096, hues: true }));
    await later();
    fusing.consider();
    expect(store.fusingPlace).toBe('here');
  });

  it('goes back to the robot when that has brought everything, and not before', async () => {
    const { store, fusing, diary, busy } = await here();
    fusing.setWish('robot');
    expect(diary.at(-1)).toBe('subscribe fused');
    expect(store.fusingPlace).toBe('here');
    busy.settings = true;
    fusing.completed(0);
    expect(store.fusingPlace).toBe('here');
    busy.settings = false;
    fusing.completed(0);
    expect(store.fusingPlace).toBe('robot');
    expect(diary.slice(-3)).toEqual(['not here', 'fuse nothing', 'left to robot']);
  });

  it.each([
    ['a comparison with temperatures of before', { method: 'thermal_change', params: {} }, 'temperatures of before'],
    ['what fades by its age', { age: { mode: 'fade', fade_s: 600 } }, 'the time when it was seen'],
  ])('leaves %s to the robot, and makes the next setting here again', async (_what, change, words) => {
    const { store, fusing, diary } = await here();
    const wanted: Fusion = { ...FUSION, ...(change as Partial<Fusion>) };
    expect(fusing.apply(wanted)).toBeNull();
    expect(diary.at(-1)).toBe('subscribe fused');
    store.fusionInForce = wanted;
    fusing.completed(0);
    expect(store.fusingPlace).toBe('robot');
    expect(diary.slice(-3)).toEqual(['not here', 'fuse nothing', 'left to robot']);
    expect(store.fusingProblem).toBeNull();
    expect(fusing.leftToRobot).toContain(words);
    fusing.consider();
    expect(store.fusingPlace).toBe('robot');
    store.fusionInForce = FUSION;
    expect(fusing.leftToRobot).toBeNull();
    fusing.consider();
    expect(diary.at(-1)).toBe('subscribe fused+temperature+visible');
    await vi.waitFor(() => expect(diary.at(-1)).toBe('facts'));
    fusing.consider();
    expect(store.fusingPlace).toBe('here');
  });

  const binned = (bins: number): Fusion => ({
    ...FUSION,
    method: 'histogram_bin',
    params: { bins, n: null, alpha: 1, invert: false, ties: 'index' },
  });
  /** As settings do: what is not made here at once is the robot's to put in force. */
  const set = ({ store, fusing }: ReturnType<typeof setUp>, fusion: Fusion) => {
    store.fusionInForce = fusing.apply(fusion) ?? fusion;
  };

  it('shows the last of several numbers of bins that came while facts of another were on their way', async () => {
    const all = await here();
    set(all, binned(18));
    expect(all.store.factsSince).not.toBeNull();
    for (const bins of [19, 20, 24]) set(all, binned(bins));
    await later();
    expect(all.asked.slice(1)).toEqual([18, 24].map((bins) => ({ method: 'fusion.facts', bins })));
    expect(all.diary.slice(-3)).toEqual(['facts', 'fuse', 'shown histogram_bin']);
    expect(all.store.fusionInForce?.params).toMatchObject({ bins: 24 });
    expect(all.store.factsSince).toBeNull();
  });

  it('makes numbers of bins of which a finer one is exactly so many times as fine, and says what others cost', async () => {
    const all = await here();
    const { store, fusing, asked } = all;
    const before = asked.length;
    for (const bins of [64, 1, 4096, 512]) expect(fusing.apply(binned(bins))).not.toBeNull();
    expect(asked).toHaveLength(before);
    expect(store.fusingCount).toBeNull();
    set(all, binned(96));
    await later();
    expect(store.fusingCount).toEqual({ method: 'histogram_bin', bytes: expect.any(Number) });
    for (const bins of [48, 24, 12, 6, 3]) expect(fusing.apply(binned(bins))).not.toBeNull();
    expect(asked).toHaveLength(before + 1);
  });

  it('uses facts that come of a map that changes faster than they come, and says that the picture is behind until it rests', async () => {
    const answers: (() => void)[] = [];
    let isSlow = false;
    const all = await here({
      answer: () => (isSlow ? new Promise((resolve) => answers.push(() => resolve({}))) : Promise.resolve({})),
    });
    const { store, fusing, diary } = all;
    isSlow = true;
    for (let i = 0; i < 6; i += 1) {
      fusing.factsChanged();
      expect(store.factsSince).not.toBeNull();
      // A setting comes into the picture all the same.
      set(all, { ...FUSION, params: { alpha: i / 10 } });
      expect(diary.at(-1)).toBe('shown thermal_visible_blend');
      diary.length = 0;
      fusing.factsChanged();
      answers.shift()!();
      await later();
      expect(diary).toEqual(['facts', 'fuse', 'shown thermal_visible_blend']);
    }
    set(all, binned(17));
    for (let i = 0; i < 4; i += 1) {
      fusing.factsChanged();
      answers.shift()!();
      await later();
    }
    expect(diary).toContain('shown histogram_bin');
    expect(store.factsSince).not.toBeNull();
    isSlow = false;
    for (const answer of answers) answer();
    await later();
    expect(store.factsSince).toBeNull();
    expect(store.fusingProblem).toBeNull();
  });

  it('asks for facts again when the robot is busy', async () => {
    let count = 0;
    const busy = new RpcError({ code: BUSY, message: 'busy', data: { field: '', reason: 'busy' } });
    const { store } = await here({ answer: () => (++count === 1 ? Promise.reject(busy) : Promise.resolve({})) });
    expect([count, store.fusingProblem]).toEqual([2, null]);
  });

  it('gives up a robot that stays busy, and says so', async () => {
    vi.useFakeTimers();
    const busy = new RpcError({ code: BUSY, message: 'busy', data: { field: '', reason: 'busy' } });
    const { store, fusing, asked } = setUp({ answer: () => Promise.reject(busy) });
    fusing.consider();
    await vi.advanceTimersByTimeAsync(LONGEST_PAUSE_MS - 1000);
    expect(store.fusingProblem).toBeNull();
    await vi.advanceTimersByTimeAsync(2000);
    expect(store.fusingProblem).toContain('too busy');
    expect(fusing.channels).toEqual(['fused']);
    const before = asked.length;
    await vi.advanceTimersByTimeAsync(LONGEST_PAUSE_MS);
    expect(asked).toHaveLength(before);
    vi.useRealTimers();
  });

  it('leaves a method that the library does not know to the robot, and says so until it knows it', async () => {
    const { store, fusing, diary } = await here();
    store.fusionInForce = { ...FUSION, method: 'of_tomorrow', params: {} };
    expect(fusing.apply(store.fusionInForce)).toBeNull();
    expect(diary.at(-1)).toBe('subscribe fused');
    fusing.completed(0);
    expect(store.fusingPlace).toBe('robot');
    expect(fusing.leftToRobot).toBe("Here method 'of_tomorrow' is unknown.");
    for (const unknown of [{ palette: 'of_tomorrow' }, { params: { alpha: 0.5, beta: 1 } }]) {
      store.fusionInForce = { ...FUSION, ...unknown } as Fusion;
      expect(fusing.leftToRobot).toMatch(/unknown|no parameter/);
      fusing.consider();
      expect(store.fusingPlace).toBe('robot');
    }
    store.fusionInForce = FUSION;
    expect(fusing.leftToRobot).toBeNull();
    fusing.consider();
    await vi.waitFor(() => expect(diary.at(-1)).toBe('facts'));
    fusing.consider();
    expect(store.fusingPlace).toBe('here');
    expect(() => fusing.apply({ ...FUSION, params: { alpha: 7 } })).toThrow(FusionRefusal);
  });

  it('is not here before what draws is ready, and gives it the library again after it has failed', async () => {
    const { store, fusing, counts, diary } = setUp({ isDrawerQuick: false });
    const modules = () => diary.filter((what) => what === 'module').length;
    fusing.consider();
    await vi.waitFor(() => expect(diary).toContain('facts'));
    counts.raw = 2;
    fusing.consider();
    expect([store.fusingPlace, store.rawShare, store.hasFusingLibrary]).toEqual(['coming', 1, false]);
    expect(fusing.apply(FUSION)).toBeNull();
    fusing.drawerHasFailed('it did not come');
    expect([store.fusingPlace, store.fusingProblem]).toEqual(['robot', 'Fusing here has failed: it did not come']);
    expect(modules()).toBe(1);
    fusing.setWish('here');
    expect(modules()).toBe(2);
    expect(store.fusingPlace).toBe('coming');
    await later();
    fusing.drawerIsReady();
    expect(store.fusingPlace).toBe('here');
    // What is set and was not made is asked of the robot.
    fusing.drawerHasFailed('it broke');
    expect(diary.slice(-2)).toEqual(['behind', 'subscribe fused']);
    expect(fusing.apply(FUSION)).toBeNull();
    fusing.completed(0);
    fusing.setWish('here');
    expect(modules()).toBe(3);
  });

  describe('and a clock', () => {
    beforeEach(() => {
      vi.useFakeTimers({ toFake: ['performance'] });
    });
    afterEach(() => {
      vi.useRealTimers();
    });

    it.each([
      ['while they are waited for', { raw: 1 }],
      ['of a tile that comes later', { raw: 2, waiting: 1 }],
    ])('goes back to the robot when raw layers do not come %s', async (_when, lacking) => {
      const all = lacking.raw === 2 ? await here() : setUp();
      const { store, fusing, counts } = all;
      fusing.consider();
      await vi.waitFor(() => expect(all.diary).toContain('facts'));
      Object.assign(counts, lacking);
      const pass = (ms: number) => {
        vi.advanceTimersByTime(ms);
        fusing.consider();
      };
      for (let i = 0; i < 2; i += 1) {
        store.rate_bytes_per_s = 1;
        pass(10);
        store.rate_bytes_per_s = 0;
        pass(10);
        pass(LONGEST_PAUSE_MS - 1);
      }
      expect(store.fusingProblem).toBeNull();
      pass(10);
      expect(store.fusingProblem).toContain('do not come');
      expect(fusing.channels).toEqual(['fused']);
    });
  });
});

describe('Fusing', () => {
  it('stays with the robot on a tiny machine, a slow link, a map that grows, and where it is not given raw layers', () => {
    const stays = ({ store, fusing }: ReturnType<typeof setUp>) => {
      fusing.consider();
      return store.fusingPlace === 'robot';
    };
    const slow = setUp();
    slow.store.costs = { raw_bytes: 2e6, change_bytes: 2e6 };
    slow.store.stats = { throughput_bytes_per_s: 10_000 } as never;
    expect(stays(slow)).toBe(true);
    expect(slow.fusing.unfit).toBe('link');
    const unmeasured = setUp();
    unmeasured.store.stats = null;
    expect(stays(unmeasured)).toBe(true);
    expect(unmeasured.fusing.unfit).toBe('unmeasured');
    const live = setUp();
    live.store.scene = { ...live.store.scene, live: true } as never;
    expect(stays(live)).toBe(true);
    expect(live.fusing.unfit).toBe('map');
    expect(stays(setUp({ capabilities: [] }))).toBe(true);
    vi.stubGlobal('navigator', { hardwareConcurrency: 1 });
    const tiny = setUp();
    expect(stays(tiny)).toBe(true);
    expect(tiny.fusing.unfit).toBe('machine');
    // Unless it is asked for.
    slow.fusing.setWish('here');
    expect(slow.store.fusingPlace).toBe('coming');
  });

  it.each([
    ['does not load', () => Promise.reject(new Error('HTTP 404')), 'HTTP 404'],
    ['does not compile', () => WebAssembly.compile(new Uint8Array([1, 2, 3])), 'could not be loaded'],
  ])('falls back and says so when the library %s', async (_what, load, words) => {
    const { store, fusing, diary } = setUp({ load });
    fusing.consider();
    await vi.waitFor(() => expect(store.fusingProblem).toContain(words));
    expect(store.fusingPlace).toBe('robot');
    expect(diary.at(-1)).toBe('subscribe fused');
    fusing.consider();
    expect(store.fusingPlace).toBe('robot');
  });

  it('falls back and says so when a tile does not fit', () => {
    const { store, fusing, diary } = setUp({ load: () => new Promise(() => undefined) });
    fusing.consider();
    fusing.failed('tile 1/0/0/0: temperatures of 3 vertices for a geometry of 4');
    expect(store.fusingPlace).toBe('robot');
    expect(store.fusingProblem).toContain('for a geometry of 4');
    expect(diary.at(-1)).toBe('subscribe fused');
  });
});
