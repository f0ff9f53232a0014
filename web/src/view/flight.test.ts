import { expect, it } from 'vitest';
import { flightTo } from './flight';

it('goes near to a place, on the side where the eye is', () => {
  const wish = flightTo([1, 0, 0], [1, 0, 5], { min: [0, 0, 0], max: [3, 4, 12] }, 0.001);
  expect(wish.target).toEqual([1, 0, 0]);
  expect(wish.distance).toBeCloseTo(13 * 0.08);
  expect(wish.preferred).toEqual([0, 0, 1]);
  expect(wish.tolerance).toBeCloseTo(0.003);
});

it('takes nothing for something in between that is no larger than a thousandth of the scene', () => {
  const { tolerance } = flightTo([0, 0, 0], [0, 0, 1], { min: [0, 0, 0], max: [3, 4, 12] }, 1);
  expect(tolerance).toBeCloseTo(0.013);
});

it('knows a way in a scene of one place, too', () => {
  const point: [number, number, number] = [1, 1, 1];
  const wish = flightTo(point, point, { min: point, max: point }, 0);
  expect(wish.distance).toBeGreaterThan(0);
  expect(wish.preferred.every(Number.isFinite)).toBe(true);
});
