import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { fittedView, guessUpAxis, viewDirection } from './first_view';

const elevation = ([x, y, z]: Vec3) => (Math.atan2(y, Math.hypot(x, z)) * 180) / Math.PI;

describe('viewDirection', () => {
  it('looks at terrain from above, at 38 degrees', () => {
    expect(elevation(viewDirection([0, 0.99, 0.01], 'y'))).toBeCloseTo(38, 5);
  });

  it('looks at a single-view scan from the side it was seen from', () => {
    const front = viewDirection([0.02, 0.23, 0.64], 'y');
    expect(front[2]).toBeGreaterThan(0.8);
    const back = viewDirection([0, 0.1, -0.7], 'y');
    expect(back[2]).toBeLessThan(-0.8);
    expect(elevation(back)).toBeGreaterThanOrEqual(13.9);
  });

  it('takes three quarters from the front for a closed surface', () => {
    const direction = viewDirection([0, 0, 0], 'y');
    expect(direction[0]).toBeGreaterThan(0.3);
    expect(direction[2]).toBeGreaterThan(0.6);
    expect(Math.hypot(...direction)).toBeCloseTo(1, 9);
  });

  it('knows scenes with z up', () => {
    expect(viewDirection([0, 0, 1], 'z')[2]).toBeCloseTo(Math.sin((38 * Math.PI) / 180), 9);
  });
});

describe('guessUpAxis', () => {
  it('takes flat ground that faces z for a map', () => {
    expect(guessUpAxis({ min: [0, 0, 0], max: [1000, 900, 40] }, [0, 0, 0.98])).toBe('z');
    expect(guessUpAxis({ min: [-4500, 0, -4500], max: [4470, 359, 4470] }, [0, 0.99, 0])).toBe('y');
    expect(guessUpAxis({ min: [-14, -6, -4], max: [4, 6, 12] }, [-0.27, 0.06, 0.55])).toBe('y');
  });
});

describe('fittedView', () => {
  const corners: Vec3[] = [-1, 1].flatMap((x) => [-2, 2].flatMap((y) => [-3, 3].map((z): Vec3 => [x + 10, y - 5, z + 100])));
  const fov = Math.PI / 4;

  /** Where a point is on the screen, -1..1. */
  function onScreen(point: Vec3, eye: Vec3, target: Vec3, aspect: number): { x: number; y: number; depth: number } {
    const unit = (a: Vec3): Vec3 => a.map((v) => v / Math.hypot(...a)) as Vec3;
    const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const dot = (a: Vec3, b: Vec3) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const forward = unit(minus(target, eye));
    const right = unit(cross(forward, [0, 1, 0]));
    const up = cross(right, forward);
    const relative = minus(point, eye);
    const depth = dot(relative, forward);
    const t = Math.tan(fov / 2);
    return { x: dot(relative, right) / depth / t / aspect, y: dot(relative, up) / depth / t, depth };
  }

  it.each([
    [1.6, { left: 0, right: 0, top: 0, bottom: 0 }],
    [0.46, { left: 0, right: 0, top: 0, bottom: 0 }],
    [1.6, { left: 0.12, right: 0.22, top: 0.03, bottom: 0.05 }],
  ])('has every point in the free part of the picture and fills it (aspect %d)', (aspect, insets) => {
    for (const facing of [
      [0, 0.6, 0],
      [0.5, 0, 0.5],
      [0, 0, -0.7],
    ] as Vec3[]) {
      const { eye, target } = fittedView(corners, viewDirection(facing, 'y'), 'y', fov, aspect, insets);
      const places = corners.map((corner) => onScreen(corner, eye, target, aspect));
      const edge = {
        left: 2 * insets.left - 1,
        right: 1 - 2 * insets.right,
        bottom: 2 * insets.bottom - 1,
        top: 1 - 2 * insets.top,
      };
      for (const { x, y, depth } of places) {
        expect(depth).toBeGreaterThan(0);
        expect(x).toBeGreaterThan(edge.left - 1e-6);
        expect(x).toBeLessThan(edge.right + 1e-6);
        expect(y).toBeGreaterThan(edge.bottom - 1e-6);
        expect(y).toBeLessThan(edge.top + 1e-6);
      }
      const width = Math.max(...places.map(({ x }) => x)) - Math.min(...places.map(({ x }) => x));
      const height = Math.max(...places.map(({ y }) => y)) - Math.min(...places.map(({ y }) => y));
      const filled = Math.max(width / (edge.right - edge.left), height / (edge.top - edge.bottom));
      expect(filled).toBeGreaterThan(0.8);
    }
  });
});
