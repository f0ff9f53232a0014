import { describe, expect, it } from 'vitest';
import type { Fusion, Method } from '../protocol/messages';
import { mergedChange, wholeChange, withChange } from './fusion_change';

const methods: Method[] = [
  {
    id: 'other',
    label: '',
    summary: '',
    needs_temperature: true,
    uses_palette: true,
    wants_fusion_safe_palette: false,
    params: [{ name: 'k', label: '', help: '', kind: 'number', default: 1 }],
  },
];
const fusion: Fusion = {
  method: 'blend',
  params: { alpha: 0.5, gain: 2 },
  params_in_force: { alpha: 0.5, gain: 2 },
  palette: 'iron',
  range: { mode: 'auto', min: 1, max: 9 },
  missing: 'visible',
};

describe('mergedChange', () => {
  it('keeps the latest value of every key', () => {
    expect(mergedChange({ params: { alpha: 0.1, k: 1 }, palette: 'a' }, { params: { alpha: 0.2 } })).toEqual({
      params: { alpha: 0.2, k: 1 },
      palette: 'a',
    });
  });

  it('forgets parameters of a method that is left', () => {
    expect(mergedChange({ method: 'a', params: { alpha: 1 } }, { method: 'b' })).toEqual({ method: 'b' });
    expect(mergedChange({ params: { alpha: 1 } }, { method: 'b', params: { k: 2 } })).toEqual({ method: 'b', params: { k: 2 } });
  });

  it('merges what is said of age', () => {
    expect(mergedChange({ age: { mode: 'fade' } }, { age: { half_life_s: 60 } })).toEqual({
      age: { mode: 'fade', half_life_s: 60 },
    });
    expect(mergedChange({ age: { mode: 'fade' } }, { palette: 'a' })).toEqual({ age: { mode: 'fade' }, palette: 'a' });
  });

  it('adds parameters to a new method', () => {
    expect(mergedChange({ method: 'b' }, { params: { k: 2 } })).toEqual({ method: 'b', params: { k: 2 } });
  });
});

describe('withChange', () => {
  it('keeps of age what is not changed, and forgets what the palette of another method stands for', () => {
    const change = { ...fusion, age: { mode: 'off' as const, half_life_s: 60 }, change_scale: { min: -5, max: 5 } };
    expect(withChange(change, { age: { mode: 'fade' } }, methods).age).toEqual({ mode: 'fade', half_life_s: 60 });
    expect(withChange(fusion, { age: { mode: 'fade' } }, methods).age).toEqual({ mode: 'fade', half_life_s: 300 });
    expect(withChange(change, { palette: 'b' }, methods).change_scale).toEqual({ min: -5, max: 5 });
    expect(withChange(change, { method: 'other' }, methods).change_scale).toBeUndefined();
    expect(wholeChange(change).age).toEqual({ mode: 'off', half_life_s: 60 });
  });

  it('starts a new method at its defaults', () => {
    expect(withChange(fusion, { method: 'other' }, methods).params).toEqual({ k: 1 });
    expect(withChange(fusion, { method: 'other', params: { k: 3 } }, methods).params).toEqual({ k: 3 });
  });

  it('lays a manual range over the automatic one, and takes it off again', () => {
    expect(withChange(fusion, { range: { mode: 'manual', min: 2, max: 3 } }, methods).range).toEqual({
      mode: 'manual',
      min: 2,
      max: 3,
    });
    expect(withChange(fusion, { range: { mode: 'auto' } }, methods).range).toEqual({ mode: 'auto', min: 1, max: 9 });
    const percentile = { mode: 'percentile' as const, low: 0.5, high: 99.5 };
    expect(withChange(fusion, { range: percentile }, methods).range).toEqual({ ...percentile, min: 1, max: 9 });
  });

  it('leaves the settings alone', () => {
    const before = structuredClone(fusion);
    withChange(fusion, { params: { alpha: 1 }, palette: 'x' }, methods);
    expect(fusion).toEqual(before);
  });
});

describe('wholeChange', () => {
  it('says everything that was set, and nothing that follows from it', () => {
    expect(wholeChange(fusion)).toEqual({
      method: 'blend',
      params: { alpha: 0.5, gain: 2 },
      palette: 'iron',
      range: { mode: 'auto' },
      missing: 'visible',
    });
  });

  it('tells a new connection how the range follows the scene, not what it came to', () => {
    expect(wholeChange({ ...fusion, range: { mode: 'percentile', min: 1, max: 9, low: 2, high: 98 } }).range).toEqual({
      mode: 'percentile',
      low: 2,
      high: 98,
    });
    expect(wholeChange({ ...fusion, range: { mode: 'manual', min: 1, max: 9 } }).range).toEqual({
      mode: 'manual',
      min: 1,
      max: 9,
    });
  });
});
