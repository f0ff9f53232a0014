import type { ProbedVertex } from '../draw/render_messages';
import { readFileSync } from 'node:fs';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { CameraPose, Extremes, Fusion, Hello, Probe, Scene, Vec3 } from '../protocol/messages';
import { RpcError } from '../transport/connection';
import { Readings } from './readings';
import { Store } from './store.svelte';

const golden = (name: string): unknown =>
  (
    JSON.parse(readFileSync(new URL(`../../../protocol/golden/messages/${name}.result.json`, import.meta.url), 'utf8')) as {
      result: unknown;
    }
  ).result;
const EXTREMES = golden('scene.extremes') as Extremes;
const PROBE = golden('scene.probe') as Probe;

const FUSION: Fusion = {
  method: 'hot',
  params: { threshold: 30 },
  params_in_force: { threshold: 30 },
  palette: 'iron',
  range: { mode: 'auto', min: 10, max: 40 },
  missing: 'visible',
};

const later = () => vi.advanceTimersByTimeAsync(0);

function setUp() {
  const store = new Store();
  store.link = { phase: 'open' };
  store.scene = { name: 'room', bounds: { min: [0, 0, 0], max: [2, 2, 1] } } as unknown as Scene;
  store.fusionInForce = FUSION;
  store.pictureStands = true;
  store.server = { capabilities: ['extremes_in_view'] } as unknown as Hello;
  const asked: {
    method: string;
    params: object;
    answer: (result: unknown) => Promise<void>;
    refuse: (error: Error) => Promise<void>;
  }[] = [];
  const seen = { extremes: [] as (Extremes | null)[], problems: [] as unknown[], aimed: [] as Vec3[] };
  const picture = { under: [1, 2, 3] as Vec3 | null, shift: 0, vertex: null as ProbedVertex | null, isBusy: false };
  const readings = new Readings(
    store,
    {
      pick: () => Promise.resolve(picture.under),
      project: ([x, y]) => ({ x: x + picture.shift, y, depth: 1 }),
      aimAt: (point) => seen.aimed.push(point),
    },
    {
      request: (method, params) =>
        new Promise((resolve, reject) => {
          asked.push({
            method,
            params,
            answer: async (result) => {
              resolve(result);
              await later();
            },
            refuse: async (error) => {
              reject(error);
              await later();
            },
          });
        }),
      onExtremes: (extremes) => seen.extremes.push(extremes),
      onProblem: (error) => seen.problems.push(error),
      isBusy: () => picture.isBusy,
      probeHere: () => Promise.resolve(picture.vertex),
    },
  );
  return { store, readings, asked, seen, picture };
}

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

describe('Readings', () => {
  it('keeps no reading of a scene that is gone', async () => {
    const { store, readings, asked } = setUp();
    const pinning = readings.pin({ x: 1, y: 2 });
    await later();
    await asked.at(-1)?.answer(PROBE);
    await pinning;
    expect(store.pinned).not.toBeNull();
    store.hover = store.pinned!.reading;
    readings.clear();
    expect([store.pinned, store.hover]).toEqual([null, null]);
  });

  it('ask for histogram and extremes once there is a picture, and not before', async () => {
    const { store, readings, asked, seen } = setUp();
    store.pictureStands = false;
    readings.askFacts();
    readings.askHistogram();
    await later();
    expect(asked).toHaveLength(0);
    await vi.advanceTimersByTimeAsync(1000);
    store.pictureStands = true;
    readings.askFacts();
    await later();
    expect(asked.map(({ method }) => method).sort()).toEqual(['scene.extremes', 'scene.histogram']);
    for (const { method, answer } of asked) await answer(golden(method));
    expect(store.histogram).toEqual(golden('scene.histogram'));
    expect(store.extremes).toEqual(EXTREMES);
    expect(seen.extremes).toEqual([EXTREMES]);
    readings.clear();
    expect([store.histogram, store.extremes]).toEqual([null, null]);
    expect(seen.extremes).toEqual([EXTREMES, null]);
  });

  it('ask for the histogram of several changes once', async () => {
    const { readings, asked } = setUp();
    for (let i = 0; i < 5; i += 1) readings.askHistogram();
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked).toHaveLength(1);
    await asked[0]!.answer(golden('scene.histogram'));
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked).toHaveLength(2);
  });

  it('show what is under the pointer, aim there, and forget it when the pointer has gone', async () => {
    const { store, readings, asked, seen } = setUp();
    readings.hover({ x: 5, y: 6 });
    await later();
    expect(asked[0]).toMatchObject({ method: 'scene.probe', params: { position: [1, 2, 3] } });
    await asked[0]!.answer(PROBE);
    expect(store.hover).toEqual({ x: 5, y: 6, probe: PROBE });
    expect(seen.aimed).toEqual([[1, 2, 3]]);
    await vi.advanceTimersByTimeAsync(1000);
    readings.hover({ x: 7, y: 8 });
    await later();
    readings.hover(null);
    expect(store.hover).toBeNull();
    // An answer that comes too late is of no interest any more.
    await asked[1]!.answer(PROBE);
    expect(store.hover).toBeNull();
  });

  it('are pinned to their place in the scene, until a place with nothing is pinned', async () => {
    const { store, readings, asked, picture } = setUp();
    void readings.pin({ x: 5, y: 6 });
    await later();
    await asked[0]!.answer(PROBE);
    const [x, y] = PROBE.position;
    expect(store.pinned).toEqual({ reading: { x: 5, y: 6, probe: PROBE }, place: { x, y, depth: 1 } });
    picture.shift = 10;
    readings.cameraMoved();
    expect(store.pinned?.place).toEqual({ x: x + 10, y, depth: 1 });
    picture.under = null;
    await readings.pin({ x: 1, y: 1 });
    expect(store.pinned).toBeNull();
    readings.cameraMoved();
    expect(store.pinned).toBeNull();
  });

  it('of what is in view are asked for where the server knows them and marks are shown; a busy server marks nothing', async () => {
    const { store, readings, asked, seen } = setUp();
    const camera = {} as CameraPose;
    const found = readings.extremesInView(camera, [0, 0, 1, 1]);
    expect(asked[0]?.params).toEqual({ camera, window: [0, 0, 1, 1] });
    await asked[0]!.answer(EXTREMES);
    expect(await found).toEqual(EXTREMES);
    const refused = readings.extremesInView(camera, [0, 0, 1, 1]);
    await asked[1]!.refuse(new RpcError({ code: -32003, message: 'busy', data: { field: '', reason: 'busy' } }));
    expect(await refused).toBeNull();
    expect(seen.problems).toEqual([]);
    store.marksShown = false;
    expect(await readings.extremesInView(camera, [0, 0, 1, 1])).toBeNull();
    expect(asked).toHaveLength(2);
  });
});

describe('Readings of a scene that changes', () => {
  const probes = (asked: { method: string }[]) => asked.filter(({ method }) => method === 'scene.probe');

  it('are asked for again, once a second at most, and only those that are shown', async () => {
    const { store, readings, asked } = setUp();
    const all = () => probes(asked) as typeof asked;
    readings.askFacts();
    readings.pictureIsOf(2, 7);
    readings.drawn(7);
    await vi.advanceTimersByTimeAsync(2500);
    expect(all()).toHaveLength(0);
    void readings.pin({ x: 5, y: 6 });
    await later();
    await all()[0]!.answer({ ...PROBE, temperature: 21.1, distance: 0.01 });
    for (let i = 0; i < 5; i += 1) readings.askFacts();
    await later();
    expect(all()).toHaveLength(2);
    expect(all()[1]!.params).toEqual({ position: [1, 2, 3] });
    await all()[1]!.answer({ ...PROBE, temperature: 80, distance: 0.01 });
    expect(store.pinned?.reading.probe.temperature).toBe(80);
    // What came meanwhile is asked once more; a picture that is known is no news.
    await vi.advanceTimersByTimeAsync(1500);
    expect(all()).toHaveLength(3);
    await all()[2]!.answer({ ...PROBE, temperature: -10, distance: 0.01 });
    readings.pictureIsOf(2, 8);
    readings.drawn(8);
    await vi.advanceTimersByTimeAsync(1500);
    expect(all()).toHaveLength(3);
    expect(store.pinned?.reading.probe.temperature).toBe(-10);
  });

  it('are asked for again where the pointer rests, once the picture of it has been drawn', async () => {
    const { store, readings, asked, picture } = setUp();
    const all = () => probes(asked) as typeof asked;
    readings.hover({ x: 7, y: 8 });
    await later();
    await all()[0]!.answer({ ...PROBE, temperature: 20 });
    readings.pictureIsOf(2, 7);
    readings.drawn(6);
    await vi.advanceTimersByTimeAsync(500);
    expect(all()).toHaveLength(1);
    picture.under = [4, 5, 6];
    readings.drawn(7);
    readings.drawn(8);
    await vi.advanceTimersByTimeAsync(500);
    expect(all()[1]!.params).toEqual({ position: [4, 5, 6] });
    await all()[1]!.answer({ ...PROBE, temperature: 80 });
    expect(store.hover?.probe.temperature).toBe(80);
    readings.hover(null);
    readings.pictureIsOf(3, 9);
    readings.drawn(9);
    await vi.advanceTimersByTimeAsync(1500);
    expect(all()).toHaveLength(2);
  });

  it('are asked for again once finer detail has been drawn', async () => {
    const { store, readings, asked, picture } = setUp();
    const all = () => probes(asked) as typeof asked;
    readings.hover({ x: 7, y: 8 });
    await later();
    await all()[0]!.answer({ ...PROBE, temperature: 57 });
    picture.under = [4, 5, 6];
    readings.differs(7);
    readings.drawn(6);
    readings.differs(8);
    readings.drawn(7);
    await vi.advanceTimersByTimeAsync(2000);
    expect(all()).toHaveLength(1);
    readings.drawn(8);
    readings.drawn(9);
    await vi.advanceTimersByTimeAsync(2000);
    expect(all()).toHaveLength(2);
    expect(all()[1]!.params).toEqual({ position: [4, 5, 6] });
    await all()[1]!.answer({ ...PROBE, temperature: 19 });
    expect(store.hover?.probe.temperature).toBe(19);
  });

  it('are asked for again where the pointer rests once the camera does, and are none on its way', async () => {
    const { store, readings, asked, picture } = setUp();
    const all = () => probes(asked) as typeof asked;
    readings.hover({ x: 7, y: 8 });
    await later();
    await all()[0]!.answer({ ...PROBE, temperature: 57 });
    expect(store.hover?.probe.temperature).toBe(57);
    picture.under = [4, 5, 6];
    for (let i = 0; i < 20; i += 1) {
      readings.cameraMoved();
      expect(store.hover).toBeNull();
      await vi.advanceTimersByTimeAsync(100);
    }
    expect(all()).toHaveLength(1);
    await vi.advanceTimersByTimeAsync(200);
    expect(all()[1]!.params).toEqual({ position: [4, 5, 6] });
    // The camera has gone on before the answer.
    readings.cameraMoved();
    await all()[1]!.answer({ ...PROBE, temperature: 40 });
    expect(store.hover).toBeNull();
    await vi.advanceTimersByTimeAsync(300);
    await all()[2]!.answer({ ...PROBE, temperature: 19 });
    expect(store.hover).toEqual({ x: 7, y: 8, probe: { ...PROBE, temperature: 19 } });
    readings.hover(null);
    readings.cameraMoved();
    await vi.advanceTimersByTimeAsync(300);
    expect(all()).toHaveLength(3);
  });

  it('have the colours of the settings in force', async () => {
    const { store, readings, asked, picture } = setUp();
    const all = () => probes(asked) as typeof asked;
    const next = async () => {
      readings.drawn(1);
      readings.drawn(1);
      await vi.advanceTimersByTimeAsync(1500);
      return all().length;
    };
    expect(await next()).toBe(0);
    void readings.pin({ x: 5, y: 6 });
    await later();
    await all()[0]!.answer({ ...PROBE, fused: [1, 1, 1], distance: 0.01 });
    expect(await next()).toBe(1);
    store.fusionInForce = { ...FUSION, range: { mode: 'manual', min: 0, max: 9 } };
    expect(await next()).toBe(2);
    await all()[1]!.answer({ ...PROBE, fused: [2, 2, 2], distance: 0.01 });
    expect(store.pinned?.reading.probe.fused).toEqual([2, 2, 2]);
    // The robot has been told of what is set here.
    store.generation += 1;
    expect(await next()).toBe(3);
    await all()[2]!.answer({ ...PROBE, temperature: 21, fused: [3, 3, 3], distance: 0.01 });
    expect(await next()).toBe(3);
    // Without a link the colours are those of here, and the temperature is what the robot has said.
    store.link = { phase: 'connecting', attempt: 2 };
    store.fusingPlace = 'here';
    picture.vertex = { position: [1, 2, 4], temperature: 20, visible: [1, 2, 3], fused: [4, 5, 6], distance: 1 };
    store.fusionInForce = FUSION;
    expect(await next()).toBe(3);
    expect(store.pinned?.reading.probe).toMatchObject({ temperature: 21, fused: [4, 5, 6] });
  });

  it('are asked for again of the same revision of another server', async () => {
    const { readings, asked } = setUp();
    const picture = (number: number) => {
      readings.pictureIsOf(1, number);
      readings.drawn(number);
      return vi.advanceTimersByTimeAsync(2500);
    };
    await picture(1);
    readings.hover({ x: 7, y: 8 });
    await later();
    await asked[0]!.answer(PROBE);
    await picture(2);
    expect(probes(asked)).toHaveLength(1);
    readings.beginConnection();
    await picture(3);
    expect(probes(asked)).toHaveLength(2);
  });

  it('go where nothing is any more', async () => {
    for (const gone of ['far', 'empty', 'no scene'] as const) {
      const { store, readings, asked } = setUp();
      const all = () => probes(asked) as typeof asked;
      void readings.pin({ x: 5, y: 6 });
      await later();
      await all()[0]!.answer({ ...PROBE, distance: 0.01 });
      await vi.advanceTimersByTimeAsync(1000);
      if (gone === 'no scene') readings.clear();
      else readings.askFacts();
      await later();
      if (gone === 'far') await all()[1]!.answer({ ...PROBE, distance: 0.5 });
      const nothing = new RpcError({ code: -32004, message: 'none', data: { field: '', reason: 'the scene has no vertex' } });
      if (gone === 'empty') await all()[1]!.refuse(nothing);
      expect(store.pinned, gone).toBeNull();
    }
  });
});

describe('How much is highlighted', () => {
  it('is known of exactly the settings for which it was asked', async () => {
    const { store, readings, asked } = setUp();
    readings.askHistogram();
    await asked[0]!.answer(golden('scene.histogram'));
    expect(store.isShareKnown).toBe(true);
    // Wanted, and not answered yet; then in force, and not asked for yet.
    store.wanted = { params: { threshold: 35 } };
    expect(store.isShareKnown).toBe(false);
    store.wanted = null;
    expect(store.isShareKnown).toBe(true);
    store.fusionInForce = { ...FUSION, params: { threshold: 35 } };
    expect(store.isShareKnown).toBe(false);
    // An answer for settings of before.
    await vi.advanceTimersByTimeAsync(200);
    readings.askHistogram();
    await later();
    store.generation += 1;
    await asked[1]!.answer(golden('scene.histogram'));
    expect([store.isShareKnown, store.histogram?.highlighted_share]).toEqual([false, undefined]);
  });

  it('is not what a robot says that does not know yet what is shown here', async () => {
    const { store, readings, asked, picture } = setUp();
    store.fusingPlace = 'here';
    store.histogram = { edges: [0, 1], counts: [1], mean: 0, sigma: 0, highlighted: [[30, 40]], highlighted_share: 0.5 };
    picture.isBusy = true;
    readings.askHistogram();
    await asked[0]!.answer(golden('scene.histogram'));
    expect(store.histogram).toMatchObject({ highlighted: [[30, 40]], highlighted_share: 0.5 });
    expect(store.histogram.edges).toEqual((golden('scene.histogram') as { edges: number[] }).edges);
    expect([store.isShareKnown, Object.keys(store.highlighting)]).toEqual([false, []]);
  });
});

describe('Readings without a link', () => {
  it('are those of the nearest vertex that is here, where colours are made here', async () => {
    const { store, readings, asked, picture } = setUp();
    store.link = { phase: 'connecting', attempt: 2 };
    picture.vertex = { position: [1, 2, 4], temperature: Infinity, visible: [1, 2, 3], fused: [4, 5, 6], distance: 1 };
    await readings.pin({ x: 5, y: 6 });
    expect(asked).toHaveLength(0);
    expect(store.pinned?.reading.probe).toMatchObject({
      position: [1, 2, 4],
      temperature: null,
      temperature_range: 'over',
      fused: [4, 5, 6],
    });
    picture.vertex = null;
    store.pinned = null;
    await readings.pin({ x: 5, y: 6 });
    expect(store.pinned).toBeNull();
  });
});
