import { describe, expect, it } from 'vitest';
import type { Histogram, Method } from '../protocol/messages';
import { highlightWords, percent } from './highlight_words';

const plain = (text: string | null) => text?.replaceAll('\u202f', ' ') ?? null;

function histogram(highlighted: [number, number][], highlighted_share?: number): Histogram {
  return {
    edges: [10, 60],
    counts: [5],
    mean: 20,
    sigma: 3,
    highlighted,
    ...(highlighted_share === undefined ? {} : { highlighted_share }),
  };
}
const method: Method = {
  id: 'of_this_test',
  label: 'Of this test',
  summary: '',
  needs_temperature: true,
  uses_palette: true,
  wants_fusion_safe_palette: false,
  params: [{ name: 'limit', label: 'Limit', help: '', kind: 'temperature', default: null }],
};
const scene = { lowest: 10, highest: 60, isPointCloud: false, decimals: 1 };
const words = (found: Histogram | null, inForce = {}) => plain(highlightWords(found, scene, method, inForce));

describe('What is highlighted', () => {
  it('is said with its share and its temperatures', () => {
    expect(words(histogram([[27.44, 60]], 0.003))).toBe('0.3 % of the surface, above 27.4 °C.');
    expect(words(histogram([[10, 14]], 0.25))).toBe('25 % of the surface, below 14.0 °C.');
    const sides: [number, number][] = [
      [10, 14],
      [50, 60],
    ];
    expect(words(histogram(sides, 0.021))).toBe('2.1 % of the surface, below 14.0 °C or above 50.0 °C.');
    expect(words(histogram([[20, 30]], 0.5))).toBe('50 % of the surface, from 20.0 °C to 30.0 °C.');
    expect(words(histogram([[10, 60]], 1))).toBe('100 % of the surface, at every temperature.');
    expect(words(histogram([...sides, [20, 21]], 0.04))).toBe('4.0 % of the surface, in 3 bands of temperature.');
    expect(plain(highlightWords(histogram([[27, 60]], 0.1), { ...scene, isPointCloud: true }, method, {}))).toBe(
      '10 % of the points, above 27.0 °C.',
    );
  });

  it('is said of the map that was counted while the scene is another one', () => {
    const said = (lowest: number, highest: number, highlighted: [number, number][]) =>
      plain(highlightWords(histogram(highlighted, 0.1), { ...scene, lowest, highest }, method, {}));
    expect(said(-20, 907, [[27, 60]])).toBe('10 % of the surface, above 27.0 °C.');
    expect(said(-20, 907, [[10, 14]])).toBe('10 % of the surface, below 14.0 °C.');
    expect(said(12, 40, [[27, 60]])).toBe('10 % of the surface, above 27.0 °C.');
    expect(said(12, 40, [[10, 14]])).toBe('10 % of the surface, below 14.0 °C.');
  });

  it('is said to be nothing, and why', () => {
    expect(words(histogram([], 0))).toBe('Nothing is highlighted.');
    expect(words(histogram([], 0), { limit: 250 })).toBe('Nothing is highlighted. Limit 250.0 °C is above the hottest, 60.0 °C.');
    expect(words(histogram([[10, 60]], 1), { limit: -5 })).toBe(
      '100 % of the surface, at every temperature. Limit −5.0 °C is below the coldest, 10.0 °C.',
    );
  });

  it('writes the decimals that tell the temperatures apart', () => {
    const found = highlightWords(histogram([[20.0004, 60]], 0.1), { ...scene, decimals: 4 }, method, { limit: 99 });
    expect(plain(found)).toMatch(/above 20\.0004 °C\. .*99\.0000 °C is above the hottest, 60\.0000 °C/);
  });

  it('is not said of a method that shows all temperatures alike, nor of a scene without any', () => {
    expect(words(histogram([]))).toBeNull();
    expect(words(null)).toBeNull();
    expect(highlightWords(histogram([], 0), { ...scene, lowest: null, highest: null }, method, {})).toBeNull();
  });

  it('counts what is only over range, too', () => {
    expect(words(histogram([], 0.001), { limit: 250 })).toBe(
      '0.1 % of the surface. Limit 250.0 °C is above the hottest, 60.0 °C.',
    );
  });
});

describe('Shares', () => {
  it('are never rounded to nothing or all', () => {
    expect([0, 0.00001, 0.0004, 0.005, 0.0126, 0.125, 0.996, 0.9999, 1].map((share) => plain(percent(share)))).toEqual([
      '0 %',
      'under 0.01 %',
      '0.04 %',
      '0.5 %',
      '1.3 %',
      '13 %',
      '99.6 %',
      'over 99.9 %',
      '100 %',
    ]);
  });
});
