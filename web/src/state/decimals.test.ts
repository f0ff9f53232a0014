import { expect, it } from 'vitest';
import { decimalsOf } from './decimals';

it('writes as many decimals as tell the temperatures of the narrowest scale apart', () => {
  const ends = (min: number | null, max: number | null) => ({ min, max });
  expect([50, 2, 1, 0.5, 0.02, 0.001, 1e-9, 1e36].map((span) => decimalsOf(ends(0, span)))).toEqual([1, 1, 1, 2, 3, 4, 4, 1]);
  expect(decimalsOf(ends(7.7, 57.2), ends(20, 20.01)), 'a range within the scene').toBe(3);
  expect(decimalsOf(ends(21, 21), ends(21, 21)), 'one temperature').toBe(1);
  expect(decimalsOf(ends(null, null), undefined), 'none').toBe(1);
});
