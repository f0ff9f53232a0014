import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { FusionRefusal } from '../fusion/fusion_refusal';
import type { Fusion, FusionChange } from '../protocol/messages';
import { BUSY, ConnectionLost, RpcError } from '../transport/connection';
import { Settings } from './settings';
import { Store } from './store.svelte';

function fusionWith(alpha: number, method = 'blend'): Fusion {
  return {
    method,
    params: { alpha },
    params_in_force: { alpha },
    palette: 'iron',
    range: { mode: 'auto', min: 10, max: 30 },
    missing: 'visible',
  };
}

function refusal(field: string, reason: string, code = -32602): RpcError {
  return new RpcError({ code, message: 'invalid', data: { field, reason } });
}

interface Asked {
  change: FusionChange;
  answer: (generation: number, fusion: Fusion) => Promise<void>;
  refuse: (error: Error) => Promise<void>;
}

/** Settings of a session that is connected, and the other end of it. */
function setUp() {
  const store = new Store();
  store.link = { phase: 'open' };
  const asked: Asked[] = [];
  const problems: unknown[] = [];
  const events = { changes: 0, inForce: 0 };
  let here: (wanted: Fusion) => Fusion | null = () => null;
  const later = () => vi.advanceTimersByTimeAsync(0);
  const settings = new Settings(store, {
    request: (method, params) =>
      new Promise((resolve, reject) => {
        expect(method).toBe('fusion.set');
        asked.push({
          change: params as FusionChange,
          answer: async (generation, fusion) => {
            resolve({ generation, fusion });
            await later();
          },
          refuse: async (error) => {
            reject(error);
            await later();
          },
        });
      }),
    onChange: () => (events.changes += 1),
    onInForce: () => (events.inForce += 1),
    onProblem: (error) => problems.push(error),
    fuseHere: (wanted) => here(wanted),
  });
  expect(settings.greeted(fusionWith(0.5), false)).toBeNull();
  const fuseHere = (how: typeof here) => {
    here = how;
  };
  return { store, settings, asked, problems, events, fuseHere };
}

describe('Settings', () => {
  it('takes a threshold along to the other method that has one, and nothing else', async () => {
    const { store, settings, asked } = setUp();
    const parameter = (name: string, kind: string) => ({ name, kind, label: name, help: '', default: null });
    const method = (id: string, params: ReturnType<typeof parameter>[]) => ({
      id,
      label: id,
      summary: '',
      needs_temperature: true,
      uses_palette: true,
      wants_fusion_safe_palette: false,
      params,
    });
    store.methods = [
      method('one', [parameter('threshold', 'temperature'), parameter('alpha', 'number')]),
      method('other', [parameter('threshold', 'temperature'), parameter('alpha', 'number')]),
      method('blend', [parameter('alpha', 'number')]),
    ];
    store.fusionInForce = { ...fusionWith(0.5, 'one'), params: { threshold: 31.5, alpha: 0.5 } };
    settings.setMethod('other');
    expect(asked[0]?.change).toEqual({ method: 'other', params: { threshold: 31.5 } });
    await asked[0]?.answer(1, { ...fusionWith(0.5, 'other'), params: { threshold: 31.5, alpha: 0.5 } });
    // Changed there, it comes back with its new value; the opacity is the method's own.
    store.fusionInForce = { ...fusionWith(0.5, 'other'), params: { threshold: null, alpha: 0.9 } };
    settings.setMethod('one');
    await vi.advanceTimersByTimeAsync(100);
    expect(asked[1]?.change).toEqual({ method: 'one', params: { threshold: null, alpha: 0.5 } });
    await asked[1]?.answer(2, fusionWith(0.5, 'one'));
    settings.setMethod('blend');
    await vi.advanceTimersByTimeAsync(100);
    expect(asked[2]?.change).toEqual({ method: 'blend' });
  });

  beforeEach(() => vi.useFakeTimers());
  afterEach(() => vi.useRealTimers());

  it('shows what is asked for at once, and what is in force when the answer has come', async () => {
    const { store, settings, asked, events } = setUp();
    settings.setParameter('alpha', 0.7, true);
    expect(asked.map(({ change }) => change)).toEqual([{ params: { alpha: 0.7 } }]);
    expect(store.fusion?.params).toEqual({ alpha: 0.7 });
    expect(store.fusionInForce?.params).toEqual({ alpha: 0.5 });
    expect([events.changes, settings.busy]).toEqual([1, true]);
    await asked[0]?.answer(1, fusionWith(0.7));
    expect([store.generation, store.fusionInForce?.params, store.wanted]).toEqual([1, { alpha: 0.7 }, null]);
    expect([events.inForce, settings.busy]).toEqual([1, false]);
  });

  it('keeps to the newest generation, in whatever order answers and notifications come', async () => {
    const { store, settings, asked, events } = setUp();
    settings.setParameter('alpha', 0.6, true);
    settings.setParameter('alpha', 0.7, true);
    settings.inForce(3, fusionWith(0.9));
    await asked[1]?.answer(2, fusionWith(0.7));
    await asked[0]?.answer(1, fusionWith(0.6));
    expect([store.generation, store.fusionInForce?.params]).toEqual([3, { alpha: 0.9 }]);
    expect(events.inForce).toBe(1);
    // The same generation again may say more of what it means, the range for one; it is no other picture.
    settings.inForce(3, { ...fusionWith(0.9), range: { mode: 'auto', min: 12, max: 28 } });
    expect(store.fusionInForce?.range.min).toBe(12);
    expect(events.inForce).toBe(1);
  });

  it('knows the method of a generation of which nothing was said by the one before', () => {
    const { settings } = setUp();
    expect(settings.methodOf(1)).toBe('blend');
    settings.inForce(5, fusionWith(0.5, 'other'));
    settings.inForce(3, fusionWith(0.5, 'late'));
    expect([0, 2, 3, 4, 5, 7].map((one) => settings.methodOf(one))).toEqual(['blend', 'blend', 'late', 'late', 'other', 'other']);
  });

  it('counts generations anew with each connection', () => {
    const { store, settings } = setUp();
    settings.inForce(7, fusionWith(0.9));
    settings.greeted(fusionWith(0.5), true);
    settings.inForce(1, fusionWith(0.4));
    expect([store.generation, store.fusionInForce?.params]).toEqual([1, { alpha: 0.4 }]);
  });

  it('shows a refusal at its field until the user changes something, and goes back to what is in force', async () => {
    const { store, settings, asked, problems } = setUp();
    settings.setParameter('alpha', 7, true);
    await asked[0]?.refuse(refusal('params.alpha', 'above 1'));
    expect(store.refusals).toEqual({ 'params.alpha': 'above 1' });
    expect(store.fusion?.params).toEqual({ alpha: 0.5 });
    settings.refused(refusal('quality.colour_bits', 'below 4'));
    settings.refused(refusal('', 'no'));
    expect(store.refusals).toEqual({ 'params.alpha': 'above 1', 'quality.colour_bits': 'below 4', '': 'no' });
    settings.setPalette('grey');
    expect(store.refusals).toEqual({});
    expect(problems).toEqual([]);
  });

  it('tells a server that was too busy again, with the newest wish', async () => {
    const { store, settings, asked } = setUp();
    settings.setParameter('alpha', 0.6, true);
    await asked[0]?.refuse(refusal('', 'too fast', BUSY));
    settings.setPalette('grey');
    await vi.advanceTimersByTimeAsync(400);
    expect(store.refusals).toEqual({});
    expect(asked.at(-1)?.change).toEqual({ params: { alpha: 0.6 }, palette: 'grey' });
  });

  it('hands anything but a refusal on', async () => {
    const { store, settings, asked, problems } = setUp();
    settings.setPalette('grey');
    await asked[0]?.refuse(new Error('out of order'));
    expect(problems).toHaveLength(1);
    expect(store.refusals).toEqual({});
  });

  it('keeps what was on its way when the connection went, and asks for it on the next', async () => {
    const { store, settings, asked, problems } = setUp();
    settings.setPalette('grey');
    await asked[0]?.refuse(new ConnectionLost());
    expect(problems).toEqual([]);
    expect(store.wanted).toMatchObject({ palette: 'grey' });
    expect(store.fusion?.palette).toBe('grey');
    expect(settings.greeted(fusionWith(0.5), true)).toMatchObject({ palette: 'grey' });
  });

  it('keeps what the user wants while there is no connection, and asks for all of it on the next', () => {
    const { store, settings, asked, events } = setUp();
    store.link = { phase: 'waiting', attempt: 1, retry_at: 0 };
    settings.setParameter('alpha', 0.9, true);
    settings.setRange(30, 20, true);
    expect([asked.length, events.changes]).toEqual([0, 0]);
    const whole = settings.greeted(fusionWith(0.5), true);
    expect(whole).toEqual({
      method: 'blend',
      params: { alpha: 0.9 },
      palette: 'iron',
      range: { mode: 'manual', min: 20, max: 30 },
      missing: 'visible',
    });
    expect(store.fusion?.params).toEqual({ alpha: 0.9 });
  });

  it('goes back to the parameters a method was left with, and to the fused view that was left', async () => {
    const { store, settings, asked } = setUp();
    const force = async (generation: number, fusion: Fusion) => await asked.at(-1)?.answer(generation, fusion);
    settings.setMethod('other');
    expect(asked.at(-1)?.change).toEqual({ method: 'other' });
    await force(1, fusionWith(1, 'other'));
    store.scene = { temperature: { min: 1, max: 2 } } as unknown as NonNullable<Store['scene']>;
    settings.setViewMode('thermal');
    expect(asked.at(-1)?.change).toEqual({ method: 'thermal_only' });
    await force(2, fusionWith(1, 'thermal_only'));
    settings.setViewMode('fused');
    expect(asked.at(-1)?.change).toEqual({ method: 'other', params: { alpha: 1 } });
    await force(3, fusionWith(1, 'other'));
    settings.setMethod('blend');
    expect(asked.at(-1)?.change).toEqual({ method: 'blend', params: { alpha: 0.5 } });
  });

  it('gives what has no temperature a colour in the thermal view alone, until the user says how it is shown', async () => {
    const { store, settings, asked } = setUp();
    const grey = Array.from({ length: 256 }, (_, i): [number, number, number] => [i, i, i]);
    const red = grey.map(([i]): [number, number, number] => [i, 0, 0]);
    store.scene = { temperature: { min: 1, max: 2 } } as unknown as NonNullable<Store['scene']>;
    store.palettes = [
      { id: 'iron', label: 'Iron', fusion_safe: true, colours: red },
      { id: 'grey', label: 'Grey', fusion_safe: true, colours: grey },
    ];
    const force = async (generation: number, method: string, missing: string, palette = 'iron') =>
      await asked.at(-1)?.answer(generation, { ...fusionWith(1, method), missing, palette });
    settings.setViewMode('thermal');
    expect(asked.at(-1)?.change).toEqual({ method: 'thermal_only', missing: '#808080' });
    await force(1, 'thermal_only', '#808080');
    settings.setPalette('grey');
    const { missing } = asked.at(-1)!.change;
    expect(missing).not.toBe('#808080');
    await force(2, 'thermal_only', missing!, 'grey');
    settings.setViewMode('fused');
    expect(asked.at(-1)?.change.missing).toBe('visible');
    await force(3, 'blend', 'visible');
    settings.setMissing('#ff00ff', true);
    await force(4, 'blend', '#ff00ff');
    settings.setViewMode('thermal');
    expect(asked.at(-1)?.change.missing).toBeUndefined();
    await force(5, 'thermal_only', '#ff00ff');
    settings.setMissing('automatic', true);
    expect(asked.at(-1)?.change).toEqual({ missing: '#808080' });
  });

  it('says what has no temperature once the palettes are there', async () => {
    const { store, settings, asked } = setUp();
    store.scene = { temperature: { min: 1, max: 2 } } as unknown as NonNullable<Store['scene']>;
    store.palettes = [];
    settings.reconsiderMissing();
    expect(asked).toEqual([]);
    settings.setViewMode('thermal');
    expect(asked.at(-1)?.change).toEqual({ method: 'thermal_only' });
    await asked.at(-1)?.answer(1, { ...fusionWith(1, 'thermal_only'), missing: 'visible' });
    const colours = Array.from({ length: 256 }, (_, i): [number, number, number] => [i, 0, 0]);
    store.palettes = [{ id: 'iron', label: 'Iron', fusion_safe: true, colours }];
    settings.reconsiderMissing();
    expect(asked.at(-1)?.change).toEqual({ missing: '#808080' });
  });

  it('keeps the visible colours where nothing has a temperature, also when a scene takes the place of one that had', async () => {
    const { store, settings, asked } = setUp();
    const colours = Array.from({ length: 256 }, (_, i): [number, number, number] => [i, 0, 0]);
    store.palettes = [{ id: 'iron', label: 'Iron', fusion_safe: true, colours }];
    const sceneWith = (min: number | null) => {
      store.scene = { temperature: { min } } as unknown as NonNullable<Store['scene']>;
      settings.reconsiderMissing();
    };
    sceneWith(null);
    expect(asked).toEqual([]);
    settings.setViewMode('thermal');
    expect(asked.at(-1)?.change).toEqual({ method: 'thermal_only' });
    await asked.at(-1)?.answer(1, fusionWith(1, 'thermal_only'));
    sceneWith(10);
    expect(asked.at(-1)?.change).toEqual({ missing: '#808080' });
    await asked.at(-1)?.answer(2, { ...fusionWith(1, 'thermal_only'), missing: '#808080' });
    sceneWith(null);
    expect(asked.at(-1)?.change).toEqual({ missing: 'visible' });
    await asked.at(-1)?.answer(3, fusionWith(1, 'thermal_only'));
    expect(asked).toHaveLength(3);
    // While there is no scene nobody knows.
    store.scene = null;
    settings.reconsiderMissing();
    expect(asked).toHaveLength(3);
    // What the user has said holds again where anything has a temperature.
    store.scene = { temperature: { min: 10 } } as unknown as NonNullable<Store['scene']>;
    settings.setMissing('#ff00ff', true);
    await asked.at(-1)?.answer(4, { ...fusionWith(1, 'thermal_only'), missing: '#ff00ff' });
    sceneWith(null);
    await vi.advanceTimersByTimeAsync(100);
    expect(asked.at(-1)?.change).toEqual({ missing: 'visible' });
    await asked.at(-1)?.answer(5, fusionWith(1, 'thermal_only'));
    sceneWith(10);
    await vi.advanceTimersByTimeAsync(100);
    expect(asked.at(-1)?.change).toEqual({ missing: '#ff00ff' });
  });

  it('names a range that follows the scene once it is in force, and one that is held at once', async () => {
    const { store, settings, asked } = setUp();
    settings.setRange(12, 28, true);
    expect(store.range).toMatchObject({ mode: 'manual', min: 12, max: 28 });
    await asked.at(-1)?.answer(1, { ...fusionWith(0.5), range: { mode: 'manual', min: 12, max: 28 } });
    store.link = { phase: 'waiting', attempt: 1, retry_at: 0 };
    settings.toggleRangeExtremes();
    expect(store.wanted?.range?.mode).toBe('auto');
    expect(store.range).toMatchObject({ mode: 'manual', min: 12, max: 28 });
    settings.inForce(2, fusionWith(0.5));
    expect(store.range).toMatchObject({ mode: 'auto', min: 10, max: 30 });
  });

  it('holds the range where it is and lets it go again', async () => {
    const { settings, asked } = setUp();
    settings.toggleRangeLock();
    expect(asked.at(-1)?.change).toEqual({ range: { mode: 'manual', min: 10, max: 30 } });
    await asked.at(-1)?.answer(1, { ...fusionWith(0.5), range: { mode: 'manual', min: 10, max: 30 } });
    settings.toggleRangeLock();
    expect(asked.at(-1)?.change).toEqual({ range: { mode: 'auto' } });
    await asked.at(-1)?.answer(2, fusionWith(0.5));
    settings.toggleRangeExtremes();
    const percentiles = { mode: 'percentile' as const, low: 0.5, high: 99.5 };
    expect(asked.at(-1)?.change).toEqual({ range: percentiles });
    await asked.at(-1)?.answer(3, { ...fusionWith(0.5), range: { ...percentiles, min: 11, max: 28 } });
    settings.toggleRangeLock();
    await asked.at(-1)?.answer(4, { ...fusionWith(0.5), range: { mode: 'manual', min: 11, max: 28 } });
    settings.toggleRangeLock();
    expect(asked.at(-1)?.change).toEqual({ range: percentiles });
  });
});

describe('Settings that are fused here', () => {
  beforeEach(() => {
    vi.useFakeTimers();
  });
  afterEach(() => {
    vi.useRealTimers();
  });

  const shownBy = (wanted: Fusion): Fusion => ({ ...wanted, params_in_force: { ...wanted.params, made: 'here' } });

  it('are in force at once, and the server is told at its leisure', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere(shownBy);
    for (let i = 0; i < 50; i += 1) {
      settings.setParameter('alpha', i / 50, true);
      expect(store.fusion?.params['alpha']).toBe(i / 50);
      expect(store.wanted).toBeNull();
      await vi.advanceTimersByTimeAsync(20);
      await asked.at(-1)?.answer(3, fusionWith(0.4));
    }
    await vi.advanceTimersByTimeAsync(2000);
    expect(asked.length).toBeLessThanOrEqual(3);
    expect(asked.at(-1)?.change.params).toMatchObject({ alpha: 49 / 50 });
    // What the server says of it is known already.
    expect(store.fusion?.params['alpha']).toBe(49 / 50);
    expect(store.generation).toBe(3);
  });

  it('are told all five seconds while they go on at a pace that people have', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere(shownBy);
    for (let i = 0; i < 100; i += 1) {
      settings.setParameter('alpha', i / 100, true);
      await asked.at(-1)?.answer(3, fusionWith(0.4));
      await vi.advanceTimersByTimeAsync(300);
    }
    expect(asked).toHaveLength(6);
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked).toHaveLength(7);
    expect(asked.at(-1)?.change.params).toMatchObject({ alpha: 99 / 100 });
  });

  it('are told at leisure as well where they are other methods, one after the other', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere(shownBy);
    for (let i = 0; i < 50; i += 1) {
      settings.setMethod(['other', 'blend'][i % 2]!);
      await vi.advanceTimersByTimeAsync(20);
      await asked.at(-1)?.answer(3, fusionWith(0.4));
    }
    await vi.advanceTimersByTimeAsync(2000);
    expect(asked.length).toBeLessThanOrEqual(3);
    expect(asked.at(-1)?.change.method).toBe('blend');
  });

  it('are told before what the server has to show after them', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere((wanted) => (wanted.method === 'robots' ? null : shownBy(wanted)));
    settings.setMethod('other');
    settings.setMethod('third');
    settings.setPalette('grey');
    settings.setMethod('robots');
    await vi.advanceTimersByTimeAsync(3000);
    expect(asked.map(({ change }) => change)).toEqual([
      { method: 'other' },
      { method: 'third', palette: 'grey' },
      { method: 'robots' },
    ]);
    await asked[0]?.answer(1, fusionWith(0.4, 'other'));
    await asked[1]?.answer(2, fusionWith(0.4, 'third'));
    expect(store.fusion?.method).toBe('robots');
    await asked[2]?.answer(3, fusionWith(0.4, 'robots'));
    expect([store.fusionInForce?.method, store.generation, settings.busy]).toEqual(['robots', 3, false]);
  });

  it('stay in force when the server answers what was asked of it before', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere((wanted) => (wanted.method === 'robots' ? null : shownBy(wanted)));
    settings.setMethod('robots');
    settings.setMethod('other');
    await asked[0]?.answer(1, fusionWith(0.4, 'robots'));
    expect([store.fusion?.method, store.generation, settings.methodOf(1)]).toEqual(['other', 1, 'robots']);
    expect(settings.answeredGeneration).toBe(1);
    store.generation = 7;
    await vi.advanceTimersByTimeAsync(2000);
    expect(asked.map(({ change }) => change.method)).toEqual(['robots', 'other']);
    await asked[1]?.answer(2, fusionWith(0.4, 'other'));
    expect([store.fusion?.method, store.generation, settings.busy, settings.answeredGeneration]).toEqual(['other', 7, false, 2]);
    settings.greeted(fusionWith(0.5), true);
    expect(settings.answeredGeneration).toBe(0);
  });

  it('take along what waits to be sent, which is not sent after them', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere((wanted) => (wanted.age?.mode === 'fade' ? null : shownBy(wanted)));
    settings.setAge({ mode: 'fade', half_life_s: 60 }, false);
    settings.setAge({ half_life_s: 90 }, false);
    settings.setAge({ mode: 'off' }, false);
    await vi.advanceTimersByTimeAsync(3000);
    expect(asked.map(({ change }) => change.age)).toEqual([
      { mode: 'fade', half_life_s: 60 },
      { mode: 'off', half_life_s: 90 },
    ]);
  });

  it('are told as a whole to a server that was too busy, whichever came meanwhile', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere(shownBy);
    settings.setParameter('alpha', 0.6, true);
    settings.setParameter('alpha', 0.7, true);
    await asked[0]?.refuse(refusal('', 'too fast', BUSY));
    await vi.advanceTimersByTimeAsync(2000);
    expect(asked.at(-1)?.change).toMatchObject({ method: 'blend', params: { alpha: 0.7 }, palette: 'iron' });
    expect(asked).toHaveLength(2);
    // And by the other way.
    await asked[1]?.answer(1, fusionWith(0.7));
    fuseHere(() => null);
    settings.setPalette('grey');
    fuseHere(shownBy);
    settings.setParameter('alpha', 0.8, true);
    await asked[2]?.refuse(refusal('', 'too fast', BUSY));
    await vi.advanceTimersByTimeAsync(2000);
    await asked[3]?.answer(2, fusionWith(0.8));
    await vi.advanceTimersByTimeAsync(2000);
    expect(asked.at(-1)?.change).toMatchObject({ params: { alpha: 0.8 }, palette: 'grey' });
  });

  it('are in force without a link, and in the picture when that has been drawn', () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.pictureMethod = 'before';
    store.fusionInForce = fusionWith(0.4);
    store.link = { phase: 'connecting', attempt: 3 };
    fuseHere(shownBy);
    settings.setParameter('alpha', 0.9, true);
    expect(store.fusionInForce?.params['alpha']).toBe(0.9);
    expect(store.wanted).toBeNull();
    expect(asked).toHaveLength(0);
    expect(store.pictureMethod).toBe('before');
  });

  it('are refused here in the words of the library', () => {
    const { store, settings, asked, fuseHere } = setUp();
    store.fusionInForce = fusionWith(0.4);
    fuseHere(() => {
      throw new FusionRefusal(103, 'alpha', 'alpha must be a number');
    });
    settings.setParameter('alpha', 7, true);
    expect(store.refusals).toEqual({ 'params.alpha': 'alpha must be a number' });
    expect(store.fusion).toEqual(fusionWith(0.4));
    expect(asked).toHaveLength(0);
  });

  it('are refused at the value that was changed, whichever of two the sentence begins with', async () => {
    const { store, settings, asked, fuseHere } = setUp();
    settings.setParameter('high', 5, true);
    await asked[0]?.refuse(refusal('params.low', 'low must not be above high'));
    expect(store.refusals).toEqual({ 'params.high': 'low must not be above high' });
    store.fusionInForce = { ...fusionWith(0.4), params: { low: 9, high: null } };
    fuseHere(() => {
      throw new FusionRefusal(105, 'low', 'low must not be above high');
    });
    settings.setParameter('high', 4, true);
    expect(store.refusals).toEqual({ 'params.high': 'low must not be above high' });
    settings.setParameter('low', 30, true);
    expect(store.refusals).toEqual({ 'params.low': 'low must not be above high' });
  });
});
