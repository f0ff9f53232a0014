import { describe, expect, it } from 'vitest';
import { SlicePace, Slices } from './slices';

describe('Slices', () => {
  it('come to every triangle once, in order, whatever the budget', () => {
    for (const budget of [1, 7, 100, 1e9]) {
      const sizes = [10, 0, 25, 3];
      const slices = new Slices(sizes);
      const seen = sizes.map(() => 0);
      while (!slices.isDone) {
        const parts = slices.next(budget);
        expect(parts.reduce((sum, { count }) => sum + count, 0)).toBeLessThanOrEqual(budget);
        for (const { object, start, count } of parts) {
          expect(start).toBe(seen[object]);
          seen[object]! += count;
        }
      }
      expect(seen).toEqual(sizes);
    }
  });

  it('have nothing to draw of nothing', () => {
    expect(new Slices([]).isDone).toBe(true);
    const empty = new Slices([0, 0]);
    expect(empty.next(5)).toEqual([]);
    expect(empty.isDone).toBe(true);
  });
});

describe('SlicePace', () => {
  /** Draws pictures of so many triangles on a machine with so many a millisecond; the longest part of the last one. */
  function longest(total: number, perMs: number): { ms: number; parts: number } {
    const pace = new SlicePace();
    let last = { ms: 0, parts: 0 };
    for (let picture = 0; picture < 8; picture += 1) {
      const slices = new Slices([total]);
      last = { ms: 0, parts: 0 };
      while (!slices.isDone) {
        const count = slices.next(pace.budget).reduce((sum, part) => sum + part.count, 0);
        const ms = count / perMs;
        pace.took(count, ms);
        last = { ms: Math.max(last.ms, ms), parts: last.parts + 1 };
      }
    }
    return last;
  }

  it('keeps the GPU busy for a moment at a time on a slow machine', () => {
    const { ms, parts } = longest(560_000, 600);
    expect(ms).toBeLessThan(30);
    expect(parts).toBeGreaterThan(20);
  });

  it('draws at once what a fast machine draws at once', () => {
    expect(longest(560_000, 100_000).parts).toBe(1);
  });

  it('learns nothing from pictures of nothing, however long the machine takes for them', () => {
    const pace = new SlicePace();
    const { budget } = pace;
    for (let i = 0; i < 5; i += 1) pace.took(0, 500);
    expect(pace.budget).toBe(budget);
  });
});
