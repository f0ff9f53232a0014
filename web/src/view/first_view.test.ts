import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { corners, fittedView, UP, UP_AXES, viewDirection, withoutStrays } from './first_view';

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

  it.each(UP_AXES)('looks down on ground when %s is up', (up) => {
    const direction = viewDirection(UP[up], up);
    const rise = direction.reduce((sum, value, axis) => sum + value * UP[up][axis]!, 0);
    expect(rise).toBeCloseTo(Math.sin((38 * Math.PI) / 180), 9);
    expect(Math.hypot(...direction)).toBeCloseTo(1, 9);
  });
});

describe('withoutStrays', () => {
  const grid = (count: number): Vec3[] => Array.from({ length: count * count }, (_, i) => [i % count, 0, Math.floor(i / count)]);

  it('leaves out a few points beyond a gap that is wider than the scene', () => {
    const scene = grid(12);
    expect(withoutStrays([...scene, [3000, 2000, 0], [-900, 0, 1]], null)).toEqual(scene);
  });

  it('keeps what belongs to the scene: a mast, a long tail, a second group of some size', () => {
    const mast = Array.from({ length: 40 }, (_, i): Vec3 => [0, i, 0]);
    const tail = Array.from({ length: 12 }, (_, i): Vec3 => [1.6 ** i, 0, 0]);
    const other = Array.from({ length: 8 }, (_, i): Vec3 => [500 + i, 0, 0]);
    for (const part of [mast, tail, other]) expect(withoutStrays([...grid(12), ...part], null)).toHaveLength(144 + part.length);
  });

  it('follows the server where it says what the scene is', () => {
    const core = { min: [0, 0, 0] as Vec3, max: [5, 1, 5] as Vec3 };
    expect(withoutStrays(grid(12), core)).toHaveLength(36);
    expect(withoutStrays([[70, 70, 70]], core)).toEqual(corners(core));
  });

  it('has an answer for one point, one place and none', () => {
    expect(withoutStrays([[1, 2, 3]], null)).toHaveLength(1);
    expect(
      withoutStrays(
        Array.from({ length: 9 }, (): Vec3 => [1, 2, 3]),
        null,
      ),
    ).toHaveLength(9);
    expect(withoutStrays([], null)).toEqual([]);
  });
});

describe('fittedView', () => {
  const box: Vec3[] = [-1, 1].flatMap((x) => [-2, 2].flatMap((y) => [-3, 3].map((z): Vec3 => [x + 10, y - 5, z + 100])));
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
      const { eye, target } = fittedView(box, viewDirection(facing, 'y'), 'y', fov, aspect, insets);
      const places = box.map((corner) => onScreen(corner, eye, target, aspect));
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

  it('shows a scene of one place from a fitting distance', () => {
    for (const place of [
      [0, 0, 0],
      [1e5, -3, 7],
    ] as Vec3[]) {
      const { eye, target } = fittedView([place, place], [0, 0, 1], 'y', fov, 1.5);
      expect(Math.hypot(target[0] - place[0], target[1] - place[1], target[2] - place[2])).toBeLessThan(1e-6);
      expect(eye[2] - target[2]).toBeCloseTo(0.5 / Math.tan(fov / 2), 6);
    }
  });
});
