import { describe, expect, it } from 'vitest';
import { SurfaceShare, vertexAreas } from './surface_share';

describe('Share of a surface', () => {
  // A small triangle beside one of three times its size.
  const positions = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 5, 0, 0, 11, 0, 0, 5, 2, 0]);
  const areas = vertexAreas({ positions, indices: Uint16Array.from([0, 1, 2, 3, 4, 5]) });
  const rgba = (marked: number[]) => Uint8Array.from({ length: 24 }, (_, i) => (marked.includes(i >> 2) ? 0 : 255));

  it('counts by what vertices stand for', () => {
    expect([...areas].map((area) => area.toFixed(4))).toEqual(['0.6667', '0.6667', '0.6667', '2.0000', '2.0000', '2.0000']);
    const share = new SurfaceShare(12);
    share.add(areas, rgba([0, 1, 2]));
    expect(share.found?.share).toBeCloseTo(0.25);
    share.add(areas, rgba([0, 1, 2, 3, 4, 5]));
    expect(share.found?.share).toBeCloseTo(0.625);
  });

  it('counts points where there are no triangles', () => {
    const share = new SurfaceShare(12);
    share.add(vertexAreas({ positions, indices: null }), rgba([5]));
    expect(share.found?.share).toBeCloseTo(1 / 6);
  });

  it('comes with colours of every part, at most some ten thousand', () => {
    const share = new SurfaceShare(80_000);
    const half = new Float32Array(40_000).fill(1);
    share.add(half, new Uint8Array(160_000).fill(0));
    share.add(half, new Uint8Array(160_000).fill(255));
    const { colours } = share.found!;
    expect(colours.length).toBeLessThanOrEqual(4 * 32768);
    expect(colours.filter((value) => value === 0).length / colours.length).toBeCloseTo(0.5, 2);
  });

  it('is none of nothing', () => {
    expect(new SurfaceShare(0).found).toBeNull();
  });
});
