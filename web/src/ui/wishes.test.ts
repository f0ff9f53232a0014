import { describe, expect, it } from 'vitest';
import type { Method } from '../protocol/messages';
import { wishPaths, wishWords } from './wishes';

const parameter = (name: string, label: string, kind: string) => ({ name, label, kind, help: '', default: null });
const methods = [
  { id: 'blend', label: 'Blend', params: [parameter('alpha', 'Opacity', 'number')] },
  { id: 'threshold', label: 'Threshold', params: [parameter('threshold', 'Threshold', 'temperature')] },
] as unknown as Method[];
const plain = (words: string[]) => words.map((word) => word.replaceAll('\u202f', ' '));

describe('wishWords', () => {
  it('tells a range that leaves the outermost temperatures out from one to the extremes', () => {
    expect(wishWords({ range: { mode: 'percentile', low: 0.5, high: 99.5 } }, methods, [], 'blend')).toEqual([
      'range 0.5\u201399.5 %',
    ]);
  });

  it('tells the ends of a narrow range apart', () => {
    const words = wishWords({ range: { mode: 'manual', min: 20.11, max: 20.14 } }, methods, [], 'blend');
    expect(plain(words)).toEqual(['range 20.110 °C to 20.140 °C']);
  });

  it('writes a temperature with the decimals of the scene', () => {
    const words = wishWords({ params: { threshold: 20.0006 } }, methods, [], 'threshold', 4);
    expect(plain(words)).toEqual(['Threshold 20.0006 °C']);
  });

  it('says what is asked for, setting by setting', () => {
    const words = wishWords(
      {
        method: 'threshold',
        params: { threshold: 31.25 },
        palette: 'iron',
        range: { mode: 'manual', min: 8, max: 40.7 },
        missing: '#404040',
      },
      methods,
      [{ id: 'iron', label: 'Iron', fusion_safe: false, colours: [] }],
      'blend',
    );
    expect(plain(words)).toEqual([
      'Threshold',
      'Threshold 31.3 °C',
      'palette Iron',
      'range 8.0 °C to 40.7 °C',
      'colour of what has no temperature',
    ]);
  });

  it('knows parameters of the method in force, automatic values, and words it does not know', () => {
    expect(wishWords({ params: { alpha: 0.75, other: true } }, methods, [], 'blend')).toEqual(['Opacity 0.75', 'other true']);
    expect(wishWords({ params: { threshold: null }, range: { mode: 'auto' } }, methods, [], 'threshold')).toEqual([
      'Threshold automatic',
      'range to the extremes',
    ]);
    expect(wishWords(null, methods, [], 'blend')).toEqual([]);
  });
});

describe('wishPaths', () => {
  it('names each control that waits', () => {
    expect(wishPaths(null)).toEqual([]);
    expect(wishPaths({ method: 'x', params: { alpha: 1, hue: null }, palette: 'iron' })).toEqual([
      'method',
      'palette',
      'params.alpha',
      'params.hue',
    ]);
  });
});
