import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { depthRange } from './depth_range';

const ahead: Vec3 = [0, 0, -1];
const ball = (z: number, radius: number) => ({ centre: [3, -2, z] as Vec3, radius });

describe('depthRange', () => {
  it('holds what is drawn before the eye, and leaves out what is behind it', () => {
    const { near, far, isWide } = depthRange([0, 0, 10], ahead, 8, [ball(2, 1), ball(-5, 2), ball(40, 3)]);
    expect(near).toBeLessThan(7);
    expect(near).toBeGreaterThan(6.9);
    expect(far).toBeGreaterThan(17);
    expect(far).toBeLessThan(17.1);
    expect(isWide).toBe(false);
  });

  it('follows what is looked at and not the size of everything: 20 cm before a label in a map of 4 km', () => {
    const { near, far, isWide } = depthRange([0, 0, 0.2], ahead, 0.2, [ball(0, 0.05), ball(0, 2800)]);
    expect(near).toBeLessThan(0.001);
    expect(near).toBeGreaterThan(0);
    expect(far).toBeGreaterThan(2800);
    expect(isWide).toBe(true);
  });

  it('is not stretched by a stray at its far end more than the ordinary depth buffer takes', () => {
    expect(depthRange([0, 0, 10], ahead, 10, [ball(0, 4), ball(-5000, 0)]).isWide).toBe(false);
    expect(depthRange([0, 0, 10], ahead, 10, [ball(0, 4), ball(-50_000, 0)]).isWide).toBe(true);
  });

  it('is a range where nothing is drawn, and where all is one place', () => {
    for (const spheres of [[], [ball(0, 0)], [ball(10, 0)]]) {
      const { near, far } = depthRange([0, 0, 10], ahead, 10, spheres);
      expect(near).toBeGreaterThan(0);
      expect(far).toBeGreaterThan(near);
      expect(Number.isFinite(far)).toBe(true);
    }
    expect(depthRange([0, 0, 0], ahead, 0, []).near).toBeGreaterThan(0);
  });
});
