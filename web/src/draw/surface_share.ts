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

/** Of what is drawn, how much is highlighted, and some of its colours. */
export interface Highlighting {
  /** Of the surface, 0 to 1. */
  share: number;
  /** Red, green, blue, and alpha, which is 0 where a vertex is highlighted; as many of each tile as its vertices count. */
  colours: Uint8Array<ArrayBuffer>;
}

/** So many vertices show what colours there are. */
const MOST_COLOURS = 32768;

/** Adds up what is highlighted of a surface: of colours whose alpha is 0 there, as the library marks them. `count`: vertices in all. */
export class SurfaceShare {
  readonly #step: number;
  readonly #colours: Uint8Array<ArrayBuffer>;
  #taken = 0;
  #passed = 0;
  #all = 0;
  #marked = 0;

  constructor(count: number) {
    this.#step = Math.max(1, Math.ceil(count / MOST_COLOURS));
    this.#colours = new Uint8Array(4 * Math.ceil(count / this.#step));
  }

  add(areas: Float32Array, rgba: ArrayLike<number>): void {
    for (let i = 0; i < areas.length; i += 1) {
      this.#all += areas[i]!;
      if (rgba[4 * i + 3] === 0) this.#marked += areas[i]!;
      if (this.#passed % this.#step === 0) {
        for (let j = 0; j < 4; j += 1) this.#colours[this.#taken + j] = rgba[4 * i + j]!;
        this.#taken += 4;
      }
      this.#passed += 1;
    }
  }

  /** Null where there is no surface. */
  get found(): Highlighting | null {
    if (!(this.#all > 0) || !Number.isFinite(this.#all)) return null;
    return { share: Math.min(1, this.#marked / this.#all), colours: this.#colours.subarray(0, this.#taken) };
  }
}
