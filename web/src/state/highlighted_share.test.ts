import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { HighlightedShare } from './highlighted_share';
import type { Store } from './store.svelte';

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

function setUp() {
  const store = {
    histogram: { edges: [0, 1], counts: [1], mean: 0, sigma: 0, highlighted: [] },
    highlighting: {},
    fusingPlace: 'here',
    fusionInForce: { method: 'hot', params: { threshold: 30 }, range: { mode: 'auto' } },
    shareOf: null,
  } as unknown as Store;
  const judged: Uint8Array[] = [];
  const highlighting = () =>
    Promise.resolve(picture.share === null ? null : { share: picture.share, colours: Uint8Array.of(1, 2, 3, 0) });
  const picture = { isUpToDate: true, share: 0.25 as number | null, highlighting };
  const share = new HighlightedShare(store, picture, (rgba) => judged.push(rgba));
  const wait = () => vi.advanceTimersByTimeAsync(200);
  return { store, picture, share, wait, judged };
}

describe('Highlighted share of what is fused here', () => {
  it('is what the picture says once it is up to date, and that of before until then', async () => {
    const { store, picture, share, wait } = setUp();
    share.changed('hot', [[30, 40]]);
    expect(store.histogram?.highlighted).toEqual([[30, 40]]);
    await wait();
    expect(store.histogram?.highlighted_share).toBe(0.25);
    const first = store.shareOf;
    expect(first).toContain('threshold');
    store.fusionInForce = { ...store.fusionInForce!, params: { threshold: 20 } };
    [picture.isUpToDate, picture.share] = [false, 0.5];
    share.changed('hot', [[20, 40]]);
    await wait();
    expect(store.histogram).toMatchObject({ highlighted: [[20, 40]], highlighted_share: 0.25 });
    expect(store.shareOf).toBe(first);
    picture.isUpToDate = true;
    await wait();
    expect(store.histogram?.highlighted_share).toBe(0.5);
    expect(store.shareOf).not.toBe(first);
  });

  it('is none where no temperature is highlighted, though rounded ones may be drawn so', async () => {
    const { store, picture, share, wait } = setUp();
    share.changed('hot', [[30, 40]]);
    await wait();
    picture.share = 1e-5;
    share.changed('hot', []);
    await wait();
    expect(store.histogram?.highlighted_share).toBe(0);
    // What is beyond the sensor's range is highlighted by no temperature.
    store.scene = { temperature: { over_range_count: 3, under_range_count: 0 } } as Store['scene'];
    share.changed('hot', []);
    await wait();
    expect(store.histogram?.highlighted_share).toBe(1e-5);
  });

  it('is nothing where a method that highlights finds nothing, and none of a method that does not', async () => {
    const { store, picture, share, wait, judged } = setUp();
    share.changed('hot', [[30, 40]]);
    await wait();
    picture.share = 0;
    share.changed('hot', []);
    await wait();
    expect(store.histogram?.highlighted_share).toBe(0);
    share.changed('all_alike', []);
    expect(store.histogram).not.toHaveProperty('highlighted_share');
    await wait();
    expect(store.histogram).not.toHaveProperty('highlighted_share');
    expect(judged).toHaveLength(3);
  });

  it('is not said where the picture cannot tell, nor when colours come from the robot again', async () => {
    const { store, picture, share, wait } = setUp();
    picture.share = null;
    share.changed('hot', [[30, 40]]);
    await wait();
    expect(store.histogram).not.toHaveProperty('highlighted_share');
    picture.share = 0.5;
    share.changed('hot', [[31, 40]]);
    (store as { fusingPlace: string }).fusingPlace = 'robot';
    await wait();
    expect(store.histogram).not.toHaveProperty('highlighted_share');
  });
});
