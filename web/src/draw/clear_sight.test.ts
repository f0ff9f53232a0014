import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { clearSight } from './clear_sight';
import { nearestHit } from './picking';
import type { TileArrays } from './render_messages';

type Geometry = Omit<TileArrays, 'rgba'>;

/** A square of half the size `half` about `centre`, spanned by two axes. */
function square(centre: Vec3, half: number, [u, v]: [number, number]): Geometry {
  const corner = (du: number, dv: number) => {
    const place = [...centre];
    place[u] = place[u]! + du * half;
    place[v] = place[v]! + dv * half;
    return place;
  };
  return {
    positions: Float32Array.from([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)].flat()),
    indices: Uint16Array.from([0, 1, 2, 0, 2, 3]),
    centre,
    radius: half * Math.SQRT2,
    point_spacing: 0,
  };
}

function sees(scene: Geometry[], eye: Vec3, target: Vec3, tolerance: number): boolean {
  const way = target.map((value, axis) => value - eye[axis]!) as Vec3;
  const distance = Math.hypot(...way);
  const hit = nearestHit(scene, { origin: eye, direction: way.map((value) => value / distance) as Vec3 }, 0);
  return hit === null || hit > distance - tolerance;
}

describe('clearSight', () => {
  const wall = square([0, 0, 0], 5, [0, 1]);
  const wish = { target: [0, 0, 0] as Vec3, distance: 2, tolerance: 0.005, preferred: [0, 0, 1] as Vec3 };

  it('takes the preferred side where it is free', () => {
    const eye = clearSight([wall], wish);
    eye?.forEach((value, axis) => expect(value).toBeCloseTo([0, 0, 2][axis]!, 9));
  });

  it('stands before a surface that it would see along its edge', () => {
    // The front of a box, which is closed behind.
    const scene = [wall, square([0, 0, -0.1], 5, [0, 1])];
    const preferred: Vec3 = [Math.sqrt(0.99), 0, 0.1];
    const [, , z] = clearSight(scene, { ...wish, preferred })!;
    expect(z).toBeGreaterThan(0.7);
    // Of a sheet that is free on both sides the preferred one is taken, however flat.
    expect(clearSight([wall], { ...wish, preferred: [0.8, 0, -0.6] })![2]).toBeLessThan(-0.5);
  });

  it('looks past a board that stands close before the target', () => {
    const scene = [wall, square([0, 0, 0.026], 0.3, [0, 1])];
    const eye = clearSight(scene, wish)!;
    expect(sees(scene, eye, wish.target, wish.tolerance)).toBe(true);
    expect(sees(scene, [0, 0, 2], wish.target, wish.tolerance)).toBe(false);
  });

  it('goes into the gap where there is no other way', () => {
    const scene = [square([0, 0, 0], 5, [0, 1]), square([0, 0, 0.026], 5, [0, 1])];
    const eye = clearSight(scene, { ...wish, preferred: [0, 0, 1] })!;
    expect(sees(scene, eye, wish.target, wish.tolerance)).toBe(true);
    expect(eye[2] > -2.1 && (eye[2] < 0 || eye[2] < 0.026)).toBe(true);
  });

  it('says so where the target is walled in', () => {
    const box = (
      [
        [0, 1],
        [0, 2],
        [1, 2],
      ] as [number, number][]
    ).flatMap((axes) =>
      [-1, 1].map((side) => {
        const centre: Vec3 = [0, 0, 0];
        centre[3 - axes[0] - axes[1]] = side * 0.0055;
        return square(centre, 0.0056, axes);
      }),
    );
    expect(clearSight(box, wish)).toBeNull();
  });
});
