import { describe, expect, it } from 'vitest';
import { nearestHit } from './picking';
import type { TileArrays } from './render_messages';

function square(z: number, indexed: boolean): Omit<TileArrays, 'rgba'> {
  return {
    positions: Float32Array.from([-1, -1, z, 1, -1, z, 1, 1, z, -1, 1, z]),
    indices: indexed ? Uint16Array.from([0, 1, 2, 0, 2, 3]) : null,
    centre: [0, 0, z],
    radius: Math.SQRT2,
    point_spacing: 1,
  };
}
const downwards = (x: number, y: number) => ({
  origin: [x, y, 10] as [number, number, number],
  direction: [0, 0, -1] as [number, number, number],
});

describe('nearestHit', () => {
  it('finds the nearest of several surfaces, front or back', () => {
    const surfaces = [square(0, true), square(4, true), square(-3, true)];
    expect(nearestHit(surfaces, downwards(0.2, 0.3), 0)).toBeCloseTo(6, 6);
    expect(nearestHit(surfaces, { origin: [0.2, 0.3, -10], direction: [0, 0, 1] }, 0)).toBeCloseTo(7, 6);
  });

  it('misses beside the surface and behind the eye', () => {
    expect(nearestHit([square(0, true)], downwards(1.2, 0), 0)).toBeNull();
    expect(nearestHit([square(20, true)], downwards(0, 0), 0)).toBeNull();
  });

  it('misses what is behind the eye and near it', () => {
    for (const indexed of [true, false]) {
      const behind = { ...square(10.5, indexed), radius: 20 };
      expect(nearestHit([behind], { origin: [1, 1, 10], direction: [0, 0, -1] }, 0.5)).toBeNull();
      expect(nearestHit([behind], { origin: [1, 1, 10], direction: [0, 0, 1] }, 0.5)).toBeCloseTo(0.5, 6);
      const ahead = square(0, indexed);
      expect(nearestHit([behind, ahead], { origin: [1, 1, 10], direction: [0, 0, -1] }, 0.01)).toBeCloseTo(10, 6);
    }
  });

  it('loses no ray that goes through a vertex or an edge between triangles', () => {
    const around = Array.from({ length: 6 }, (_, i) => [0.013 * Math.cos(i * 1.1), 0.011 * Math.sin(i * 1.1), 0.001 * (i % 2)]);
    const middle = Array.from(Float32Array.from([12.513, -7.251, 1.487]));
    const fan = {
      ...square(0, true),
      positions: Float32Array.from([...middle, ...around.flatMap((p) => p.map((value, axis) => value + middle[axis]!))]),
      indices: Uint16Array.from(around.flatMap((_, i) => [0, 1 + i, 1 + ((i + 1) % 6)])),
      centre: middle as [number, number, number],
    };
    for (let i = 0; i < 2000; i += 1) {
      const eye = [middle[0]! + 40 * Math.sin(i), middle[1]! + 40 * Math.cos(i), middle[2]! + 30 + (i % 7)];
      const way = middle.map((value, axis) => value - eye[axis]!);
      const length = Math.hypot(...way);
      const direction = way.map((value) => value / length) as [number, number, number];
      expect(nearestHit([fan], { origin: eye as [number, number, number], direction }, 0), `from ${eye}`).toBeCloseTo(length, 3);
    }
  });

  it('finds a point of a cloud within the cone alone', () => {
    expect(nearestHit([square(0, false)], downwards(0.98, 0.98), 0.01)).toBeCloseTo(10, 6);
    expect(nearestHit([square(0, false)], downwards(0.5, 0.5), 0.01)).toBeNull();
  });
});
