import { describe, expect, it } from 'vitest';
import { columnWidth, mostImportant, positionOf, roundTicks, sharesBeyond, spreadApart, travelOf, valueAt } from './scale';

const base = { label: '', help: '' };

describe('mostImportant', () => {
  it('keeps those of lowest rank where they stand', () => {
    const rank = (word: string) => word.length;
    expect(mostImportant(['ccc', 'a', 'bb', 'd'], 3, rank)).toEqual(['a', 'bb', 'd']);
    expect(mostImportant(['a', 'd', 'e'], 2, rank)).toEqual(['a', 'd']);
    expect(mostImportant(['a', 'd'], 5, rank)).toEqual(['a', 'd']);
  });
});

describe('sharesBeyond', () => {
  const histogram = { edges: [0, 10, 20, 30, 40], counts: [10, 60, 20, 10] };
  it('counts whole bins, and parts of those that an end cuts', () => {
    expect(sharesBeyond(histogram, 0, 40)).toEqual({ below: 0, above: 0 });
    expect(sharesBeyond(histogram, 10, 30)).toEqual({ below: 0.1, above: 0.1 });
    expect(sharesBeyond(histogram, 15, 25).below).toBeCloseTo(0.4, 12);
    expect(sharesBeyond(histogram, 15, 25).above).toBeCloseTo(0.2, 12);
    expect(sharesBeyond(histogram, 50, 60)).toEqual({ below: 1, above: 0 });
    expect(sharesBeyond(histogram, 15, 25, { below: 0.005, above: 0 })).toEqual({ below: 0.005, above: 0 });
    expect(sharesBeyond(histogram, -9, -5)).toEqual({ below: 0, above: 1 });
  });
  it('counts nobody in the sliver between an end and the hottest', () => {
    const room = { edges: [18, 20, 31], counts: [16, 8] };
    expect(sharesBeyond(room, 18.002, 30.99)).toEqual({ below: 0, above: 0 });
  });
  it('knows a scene of one temperature, and one of none', () => {
    const one = { edges: [20, 20, 20], counts: [7, 0] };
    expect(sharesBeyond(one, 20, 20)).toEqual({ below: 0, above: 0 });
    expect(sharesBeyond(one, 25, 30)).toEqual({ below: 1, above: 0 });
    expect(sharesBeyond(one, 10, 15)).toEqual({ below: 0, above: 1 });
    expect(sharesBeyond({ edges: [], counts: [] }, 0, 1)).toEqual({ below: 0, above: 0 });
  });
});

describe('roundTicks', () => {
  it.each([
    [8, 37, 10, 5, 0],
    [20.02, 20.31, 6, 0.05, 2],
    [-40, 1200, 8, 200, 0],
  ])('of %d to %d are round', (lo, hi, wanted, step, decimals) => {
    const ticks = roundTicks(lo, hi, wanted);
    expect(ticks.step).toBeCloseTo(step, 12);
    expect(ticks.decimals).toBe(decimals);
    expect(ticks.values[0]).toBeGreaterThanOrEqual(lo - 1e-9);
    expect(ticks.values.at(-1)).toBeLessThanOrEqual(hi + 1e-9);
  });

  it('of nothing are one', () => {
    expect(roundTicks(5, 5, 8).values).toEqual([5]);
  });
});

describe('Slider travel', () => {
  it('is even where the default is not near an end', () => {
    const travel = travelOf({ ...base, name: 'alpha', kind: 'number', default: 0.5, min: 0, max: 1, step: 0.01 });
    expect(travel.power).toBe(1);
    expect(valueAt(travel, 0.333)).toBe(0.33);
    expect(valueAt(travel, 1)).toBe(1);
  });

  it('puts the default of a very wide range in the middle', () => {
    const travel = travelOf({ ...base, name: 'k', kind: 'number', default: 1, exclusive_min: 0, max: 100, step: 0.01 });
    expect(positionOf(travel, 1)).toBeCloseTo(0.5, 6);
    expect(valueAt(travel, 0)).toBeGreaterThan(0);
    expect(valueAt(travel, 1)).toBe(100);
  });

  it('goes round once for an angle, and knows a wide range whose default is automatic', () => {
    const hue = travelOf({ ...base, name: 'hue', kind: 'number', default: null, unit: 'deg', step: 1 });
    expect([hue.min, hue.max, valueAt(hue, 0.5)]).toEqual([0, 360, 180]);
    const n = travelOf({ ...base, name: 'n', kind: 'integer', default: null, min: 0, max: 4096, step: 1 });
    expect(valueAt(n, 0.5)).toBe(64);
  });

  it('gives whole numbers for integers', () => {
    const travel = travelOf({ ...base, name: 'bins', kind: 'integer', default: 64, min: 1, max: 4096 });
    for (let i = 0; i <= 20; i += 1) expect(Number.isInteger(valueAt(travel, i / 20))).toBe(true);
    expect([valueAt(travel, 0), valueAt(travel, 1)]).toEqual([1, 4096]);
  });

  it('comes back to where it was', () => {
    for (const parameter of [
      { ...base, name: 'a', kind: 'number', default: 0, min: 0, max: 360 },
      { ...base, name: 'b', kind: 'number', default: 0.6, min: 0, max: 4, step: 0.05 },
      { ...base, name: 'c', kind: 'integer', default: 8, min: 0, max: 4096 },
    ]) {
      const travel = travelOf(parameter);
      for (let i = 0; i <= 10; i += 1) {
        const value = valueAt(travel, i / 10);
        expect(valueAt(travel, positionOf(travel, value))).toBeCloseTo(value, 9);
      }
    }
  });

  it('gives an open end a sensible one', () => {
    expect(travelOf({ ...base, name: 'k', kind: 'number', default: 1, min: 0 }).max).toBe(8);
  });
});

describe('columnWidth', () => {
  it('has room for the numbers of the axis, whatever they are', () => {
    expect(columnWidth([], [])).toBe(0);
    expect(columnWidth(['20', '30'], ['10.6', '40.3'])).toBeLessThanOrEqual(40);
    expect(columnWidth(['310'], ['316.3', '301.0'])).toBeGreaterThan(40);
    expect(columnWidth(['2e35', '8e35'], ['1e36'])).toBeGreaterThanOrEqual(40);
    // A minus sign is wider than a digit.
    expect(columnWidth([], ['\u2212200.0'])).toBeGreaterThan(columnWidth([], ['1200.0']));
  });
});

describe('spreadApart', () => {
  it('keeps order and distance', () => {
    const placed = spreadApart([50, 48, 49, 200], 15, 0, 300);
    const inOrder = [placed[1], placed[2], placed[0], placed[3]] as number[];
    for (let i = 1; i < 4; i += 1) expect((inOrder[i] ?? 0) - (inOrder[i - 1] ?? 0)).toBeGreaterThanOrEqual(15);
  });

  it('stays inside', () => {
    const placed = spreadApart([299, 298, 297], 15, 0, 300);
    expect(Math.max(...placed)).toBeLessThanOrEqual(300);
  });
});
