import { describe, expect, it } from 'vitest';
import { spacingOf, summaryOf } from './summary';

/** Points on a plane, each moved by at most `jitter` of their spacing. */
function plane(side: number, spacing: number, jitter: number): Float32Array<ArrayBuffer> {
  let seed = 7;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647 - 0.5;
  const positions: number[] = [];
  for (let x = 0; x < side; x += 1)
    for (let y = 0; y < side; y += 1)
      positions.push((x + random() * 2 * jitter) * spacing, (y + random() * 2 * jitter) * spacing, 5);
  return Float32Array.from(positions);
}

describe('summaryOf', () => {
  it('leaves out of sphere and sample what belongs to no triangle', () => {
    const positions = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 1e6, 0, 0]);
    const mesh = summaryOf(positions, Uint16Array.from([0, 1, 2]));
    expect(mesh.vertex_count).toBe(4);
    expect(mesh.centre).toEqual([1, 1, 0]);
    expect(mesh.radius).toBeCloseTo(Math.SQRT2, 6);
    expect([...mesh.sample]).toEqual([0, 0, 0, 2, 0, 0, 0, 2, 0]);
    expect(summaryOf(positions, null).radius).toBeCloseTo(5e5, 0);
  });

  it('sums normals and areas', () => {
    const positions = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0]);
    expect(summaryOf(positions, Uint16Array.from([0, 1, 2, 0, 2, 1]))).toMatchObject({ normal_sum: [0, 0, 0], area_sum: 8 });
  });
});

describe('A mesh without any surface', () => {
  it('has a spacing, for its vertices are drawn as points', () => {
    const line = Float32Array.from({ length: 30 }, (_, i) => (i % 3 === 0 ? i / 3 : 0));
    expect(summaryOf(line, Uint16Array.from([0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 9])).point_spacing).toBe(2);
  });
});

describe('spacingOf', () => {
  it.each([0, 0.3, 0.5])('measures how far points are apart (strewn by %d)', (jitter) => {
    const spacing = spacingOf(plane(61, 0.25, jitter));
    expect(spacing / 0.25).toBeGreaterThan(0.85);
    expect(spacing / 0.25).toBeLessThan(1.3);
  });

  it('has an answer for few points', () => {
    expect(spacingOf(Float32Array.from([1, 2, 3]))).toBe(0);
    expect(spacingOf(Float32Array.from([0, 0, 0, 3, 4, 0]))).toBe(0);
    expect(spacingOf(new Float32Array(300))).toBe(0);
  });
});
