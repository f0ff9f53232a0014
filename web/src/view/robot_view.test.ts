import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { between, chaseView, lineThrough, markerOf, type Stand } from './robot_view';

/** Looks along -z from the origin, 100 px at a metre. */
const project = ([x, y, z]: Vec3) => (z >= 0 ? null : { x: (100 * x) / -z, y: (-100 * y) / -z, depth: -z });
const STAND: Stand = { position: [0, 0, -10], forward: [1, 0, 0], up: [0, 1, 0] };

describe('The robot in the picture', () => {
  it('has a line behind it, without what is behind who looks', () => {
    const points: Vec3[] = [
      [0, 0, -1],
      [1, 0, -1],
      [1, 0, 1],
      [2, 0, -2],
      [2, 1, -2],
    ];
    expect(lineThrough(points, project)).toBe('M0.0 0.0L100.0 0.0M100.0 0.0L100.0 -50.0'.replaceAll('-0.0', '0.0'));
  });

  it('has a marker that is never too small to tell which way it looks', () => {
    const width = (stand: Stand) => {
      const marker = markerOf(stand, project)!;
      const xs = [...marker.d.matchAll(/[ML](-?[\d.]+)/g)].map((found) => Number(found[1]));
      return Math.max(...xs) - marker.x;
    };
    expect(width(STAND)).toBeGreaterThan(17);
    expect(width({ ...STAND, position: [0, 0, -1000] })).toBeGreaterThan(17);
    expect(width({ ...STAND, position: [0, 0, -1] })).toBeGreaterThan(24);
    expect(markerOf({ ...STAND, position: [0, 0, 1] }, project)).toBeNull();
  });

  it('goes evenly from one place to the next', () => {
    const to: Stand = { position: [2, 0, -10], forward: [0, 0, -1], up: [0, 1, 0] };
    const middle = between(STAND, to, 0.5);
    expect(middle.position).toEqual([1, 0, -10]);
    expect(Math.hypot(...middle.forward)).toBeCloseTo(1, 6);
    expect(middle.forward[0]).toBeCloseTo(Math.SQRT1_2, 6);
    expect(between(STAND, { ...STAND, forward: [-1, 0, 0] }, 0.5).forward).toEqual([-1, 0, 0]);
  });

  it('is followed from behind and above, whatever way it nods', () => {
    for (const forward of [
      [1, 0, 0],
      [0.8, -0.6, 0],
      [0.6, 0.8, 0],
    ] as Vec3[]) {
      const { eye, target } = chaseView({ ...STAND, forward }, [0, 1, 0]);
      expect(eye[0]).toBeLessThan(-1);
      expect(eye[1]).toBeGreaterThan(1);
      expect(eye[2]).toBeCloseTo(-10, 6);
      expect(target[0]).toBeGreaterThan(0.5);
    }
    const down = chaseView({ ...STAND, forward: [0, -1, 0] }, [0, 1, 0]);
    expect(down.eye.every(Number.isFinite)).toBe(true);
  });
});
