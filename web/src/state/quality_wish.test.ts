import { readFileSync } from 'node:fs';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { Hello, Quality } from '../protocol/messages';
import { ConnectionLost, RpcError } from '../transport/connection';
import { QualityWish } from './quality_wish';
import { Store } from './store.svelte';

const golden = JSON.parse(
  readFileSync(new URL('../../../protocol/golden/messages/quality.set.result.json', import.meta.url), 'utf8'),
) as { result: { quality: Quality } };
const IN_FORCE: Quality = { ...golden.result.quality, mode: 'manual', marks: false, colour_bits: 7 };

function setUp() {
  const store = new Store();
  store.server = { capabilities: ['marks'] } as unknown as Hello;
  const asked: {
    params: Partial<Quality>;
    answer: (quality: Quality) => Promise<void>;
    refuse: (error: Error) => Promise<void>;
  }[] = [];
  const seen = { changes: 0, refusals: [] as RpcError[], problems: [] as unknown[] };
  const later = () => vi.advanceTimersByTimeAsync(0);
  const wish = new QualityWish(store, {
    request: (method, params) =>
      new Promise((resolve, reject) => {
        expect(method).toBe('quality.set');
        asked.push({
          params,
          answer: async (quality) => {
            resolve({ ...golden.result, quality });
            await later();
          },
          refuse: async (error) => {
            reject(error);
            await later();
          },
        });
      }),
    onChange: () => (seen.changes += 1),
    onRefusal: (error) => seen.refusals.push(error),
    onProblem: (error) => seen.problems.push(error),
  });
  expect(wish.greeted(IN_FORCE, false)).toBeNull();
  return { store, wish, asked, seen };
}

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

describe('QualityWish', () => {
  it('shows a wish at once, sends what comes meanwhile as one, and takes in what the server makes of it', async () => {
    const { store, wish, asked, seen } = setUp();
    wish.set({ colour_bits: 6 });
    expect(store.quality?.colour_bits).toBe(6);
    await vi.advanceTimersByTimeAsync(0);
    expect(asked.map(({ params }) => params)).toEqual([{ mode: 'manual', colour_bits: 6 }]);
    wish.set({ colour_bits: 5 });
    wish.set({ pixel_error: 2 });
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked).toHaveLength(1);
    await asked[0]!.answer({ ...IN_FORCE, colour_bits: 6 });
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked[1]?.params).toEqual({ mode: 'manual', colour_bits: 5, pixel_error: 2 });
    await asked[1]!.answer({ ...IN_FORCE, colour_bits: 5, pixel_error: 3 });
    expect(store.quality).toMatchObject({ colour_bits: 5, pixel_error: 3 });
    expect(seen).toEqual({ changes: 2, refusals: [], problems: [] });
  });

  it('is told to a new connection when the user has chosen it, and not otherwise', () => {
    const { store, wish } = setUp();
    expect(wish.greeted({ ...IN_FORCE, colour_bits: 8 }, true)).toBeNull();
    expect(store.quality?.colour_bits).toBe(8);
    wish.set({ colour_bits: 4 });
    expect(wish.greeted(IN_FORCE, true)).toMatchObject({ colour_bits: 4 });
    expect(store.quality?.colour_bits).toBe(4);
  });

  it("follows the scene's step until the user has chosen", () => {
    const { store, wish } = setUp();
    wish.sceneHasStep(0.004);
    expect(store.quality?.position_step_mm).toBe(4);
    wish.set({ position_step_mm: 2 });
    wish.sceneHasStep(0.008);
    expect(store.quality?.position_step_mm).toBe(2);
  });

  it('asks for marks once, where the server knows them, and not where lines are off', async () => {
    const { store, wish, asked } = setUp();
    store.outlineWish = 'off';
    wish.askMarks();
    expect(asked).toHaveLength(0);
    store.outlineWish = 'automatic';
    wish.askMarks();
    wish.askMarks();
    expect(asked.map(({ params }) => params.marks)).toEqual([true]);
    store.outlineWish = 'off';
    wish.askMarks();
    expect(asked.map(({ params }) => params.marks)).toEqual([true, false]);
    store.server = { capabilities: [] } as unknown as Hello;
    store.outlineWish = 'on';
    wish.askMarks();
    expect(asked).toHaveLength(2);
  });

  it('tells refusals from lost connections', async () => {
    const { wish, asked, seen } = setUp();
    void wish.send({ colour_bits: 1 });
    void wish.send({ colour_bits: 2 });
    const refusal = new RpcError({ code: -32602, message: 'invalid', data: { field: 'colour_bits', reason: 'too few' } });
    await asked[0]!.refuse(refusal);
    await asked[1]!.refuse(new ConnectionLost());
    expect(seen.refusals).toEqual([refusal]);
    expect(seen.problems).toHaveLength(1);
  });
});
