import { describe, expect, it } from 'vitest';
import {
  accuracyWords,
  beyondWords,
  bytes,
  celsius,
  count,
  duration,
  extent,
  figures,
  length,
  liveWords,
  reading,
} from './format';

const plain = (text: string | null) => text?.replaceAll('\u202f', ' ') ?? null;

describe('Numbers', () => {
  it('have SI prefixes for counts', () => {
    expect([0, 7, 999, 1000, 40_200, 990_044, 999_600, 1_968_483].map((n) => plain(count(n)))).toEqual([
      '0',
      '7',
      '999',
      '1.00 k',
      '40.2 k',
      '990 k',
      '1.00 M',
      '1.97 M',
    ]);
    expect(plain(bytes(512))).toBe('512 B');
    expect(plain(bytes(1_230_000))).toBe('1.23 MB');
  });

  it('tell how new a live map is', () => {
    const words = (age_s: number | null) => plain(liveWords(age_s, false, false));
    expect([null, 0, 0.44, 9.94, 9.96, 59.9, 245, 90_000].map(words)).toEqual([
      'live',
      'live, newest 0.0 s',
      'live, newest 0.4 s',
      'live, newest 9.9 s',
      'live, newest 9 s',
      'live, newest 59 s',
      'live, newest 4 min',
      'live, newest 25 h',
    ]);
    expect(plain(liveWords(245, false, true))).toBe('live, 4 min');
    expect(liveWords(null, true, false)).toBe('live, empty');
  });

  it('have one decimal for temperatures and a real minus sign', () => {
    expect(plain(celsius(-3.14))).toBe('−3.1 °C');
    expect(plain(celsius(-0.04))).toBe('0.0 °C');
    expect(celsius(null)).toBe('none');
    expect([celsius(Infinity), celsius(-Infinity)]).toEqual(['over range', 'under range']);
  });

  it('says what there is where no temperature is a number', () => {
    expect(plain(beyondWords({ over_range_count: 3600 }))).toBe('3.60 k over range');
    expect(beyondWords({ under_range_count: 5 })).toBe('5 under range');
    expect(plain(beyondWords({ over_range_count: 3600, under_range_count: 12 }))).toBe('3.60 k over, 12 under range');
  });

  it('have a power of ten where a fill value would be 37 digits wide', () => {
    expect([1e36, 9.96e35, 3.3e30, -1e9, 12_500_000, 1_250_000, 999_999].map((t) => plain(celsius(t)))).toEqual([
      '1e36 °C',
      '1e36 °C',
      '3.3e30 °C',
      '−1e9 °C',
      '1.3e7 °C',
      '1250000 °C',
      '999999.0 °C',
    ]);
    expect(figures(6.664912760815277e35, 3)).toBe('6.7e35');
  });

  it('say what a sensor could not', () => {
    expect(plain(reading({ temperature: 21.5 }))).toBe('21.5 °C');
    expect(plain(reading({ temperature: 21.5004 }, 3))).toBe('21.500 °C');
    expect(plain(reading({ temperature: 21.5, temperature_sigma: 0.002 }, 3))).toBe('21.500 ± 0.002 °C');
    expect(reading({ temperature: null })).toBe('no temperature');
    expect(plain(reading({ temperature: 34.61, temperature_sigma: 0.32 }))).toBe('34.6 ± 0.3 °C');
    expect(plain(reading({ temperature: 34.61, temperature_sigma: 0.02 }))).toBe('34.6 ± 0.1 °C');
    expect(reading({ temperature: null, temperature_sigma: 0.3 })).toBe('no temperature');
    expect(reading({ temperature: null, temperature_range: 'over' })).toBe('over range');
    expect(reading({ temperature: null, temperature_range: 'under' })).toBe('under range');
  });

  it('have fitting lengths', () => {
    expect([0.0005, 0.002, 0.25, 12.345, 4500].map((m) => plain(length(m, true)))).toEqual([
      '0.5 mm',
      '2 mm',
      '25 cm',
      '12.3 m',
      '4.5 km',
    ]);
    expect([0.0005, 0.25, 4500].map((m) => plain(length(m, false)))).toEqual(['0.0005 units', '0.25 units', '4500 units']);
    expect(figures(0.000123456, 3)).toBe('0.000123');
  });

  it('have ages', () => {
    expect([3.7, 99, 130, 7300].map((s) => plain(duration(s)))).toEqual(['3 s', '99 s', '2 min', '2 h']);
  });

  it('say how exact the picture is', () => {
    const words = (position_m: number, colour_levels: number, temperature_celsius: number | null, isSettled: boolean) =>
      plain(
        accuracyWords(
          { position_m, colour_levels, temperature_celsius, rounding_levels: 0, rounding_celsius: 0 },
          isSettled,
          true,
        ),
      );
    expect(words(0.04, 2.1, 0.395, false)).toBe('coarse: within 4 cm, 3 levels, 0.4 °C');
    expect(words(0.002, 0.2, 0.001, true)).toBe('within 2 mm, 1 level, 0.01 °C');
    expect(words(0.002, 0, 0, true)).toBe('within 2 mm, colours exact');
    // Of settings that are still to come.
    expect(words(0.002, 0, 0, false)).toBe('coarse: within 2 mm');
    expect(words(0.002, 3, null, true)).toBe('within 2 mm, 3 levels');
    expect(words(0.002, Number.NaN, null, true)).toBe('within 2 mm, colours coarse');
    expect(words(3.4, 255, 30.1, false)).toBe('coarse: within 3.4 m, colours coarse, 30.1 °C');
    const rounded = { position_m: 0.002, colour_levels: 0, temperature_celsius: 0, rounding_levels: 2, rounding_celsius: 0 };
    expect(plain(accuracyWords(rounded, true, true))).toBe('within 2 mm, 2 levels, 0 °C');
    expect(plain(accuracyWords(rounded, true, false))).toBe('within 0.002 units, 2 levels, 0 °C');
    // Without a power of ten, and still no less than it is.
    expect(plain(accuracyWords({ ...rounded, position_m: 8.3e-7 }, true, false))).toBe('within 0.000001 units, 2 levels, 0 °C');
    expect(accuracyWords(null, true, true)).toBeNull();
    // What is made here of temperatures in steps is not exact.
    const here = (rounding_celsius: number, more = {}) =>
      plain(accuracyWords({ ...rounded, rounding_levels: 0, rounding_celsius, ...more }, true, true));
    expect(here(Math.fround(0.01) / 2)).toBe('within 2 mm, colours to 0.005 °C');
    expect(here(0.00763)).toBe('within 2 mm, colours to 0.0077 °C');
    expect(here(0.0001)).toBe('within 2 mm, colours to 0.0001 °C');
    expect(here(0.005, { colour_levels: 2, temperature_celsius: 0.3 })).toBe('within 2 mm, 2 levels, 0.31 °C');
    expect(here(0.005, { temperature_celsius: null })).toBe('within 2 mm, colours exact');
  });
});

describe('The size of a scene', () => {
  it('is in metres along each axis, so that a file in millimetres is noticed', () => {
    const bounds = { min: [0, -1000, 10] as [number, number, number], max: [3000, 2000, 50] as [number, number, number] };
    expect(plain(extent({ bounds, metric: true }))).toBe('3 000 × 3 000 × 40 m');
    const core_bounds = { min: [0, 0, 0] as [number, number, number], max: [3, 2.71828, 0.04567] as [number, number, number] };
    expect(plain(extent({ bounds, core_bounds, metric: true }))).toBe('3 × 2.72 × 0.0457 m');
    expect(plain(extent({ bounds: { min: [0, 0, 0], max: [1_234_567, 0, 0] }, metric: true }))).toBe('1 234 567 × 0 × 0 m');
  });

  it('is in units where nobody has said what they are', () => {
    const bounds = { min: [0, 0, 0] as [number, number, number], max: [3000, 2000, 50] as [number, number, number] };
    expect(plain(extent({ bounds, metric: false }))).toBe('3 000 × 2 000 × 50 units');
    expect(plain(extent({ bounds }))).toBe('3 000 × 2 000 × 50 units');
  });
});
