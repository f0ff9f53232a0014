import type { TileArrays } from './render_messages';

/** The surface that each vertex stands for, a third of its triangles, m^2; of a point cloud every point stands for as much. */
export function vertexAreas({ positions, indices }: Pick<TileArrays, 'positions' | 'indices'>): Float32Array {
  const areas = new Float32Array(positions.length / 3);
  if (indices === null) return areas.fill(1);
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [3 * indices[i]!, 3 * indices[i + 1]!, 3 * indices[i + 2]!];
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    const third = Math.sqrt(x * x + y * y + z * z) / 6;
    for (const vertex of [a / 3, b / 3, c / 3]) areas[vertex]! += third;
  }
  return areas;
}

/** Adds up what is highlighted of a surface: of colours whose alpha is 0 there, as the library marks them. */
export class SurfaceShare {
  #all = 0;
  #marked = 0;

  add(areas: Float32Array, rgba: ArrayLike<number>): void {
    for (let i = 0; i < areas.length; i += 1) {
      this.#all += areas[i]!;
      if (rgba[4 * i + 3] === 0) this.#marked += areas[i]!;
    }
  }

  /** 0 to 1; null where there is no surface. */
  get share(): number | null {
    return this.#all > 0 && Number.isFinite(this.#all) ? Math.min(1, this.#marked / this.#all) : null;
  }
}
