import type { GeometrySummary } from './messages';

type Indices = Uint16Array | Uint32Array;

/** Most vertices of a geometry in its summary's sample. */
const SAMPLED_VERTICES = 1000;
/** Points whose distance to their neighbours is measured. */
const MEASURED_POINTS = 24;
/** On a surface the fourth nearest neighbour is as far away as the points of an even grid of the same density, however they are strewn. */
const NEIGHBOUR = 4;

/** The sphere is for culling and for the range of depths; sample and normals are for the first view. */
export function summaryOf(positions: Float32Array, indices: Indices | null): GeometrySummary {
  const drawn = indices === null ? null : usedVertices(positions.length / 3, indices);
  const { centre, radius } = sphereOf(positions, drawn);
  const normals = normalsOf(positions, indices);
  return {
    vertex_count: positions.length / 3,
    triangle_count: (indices?.length ?? 0) / 3,
    centre,
    radius,
    sample: sampleOf(positions, drawn),
    point_spacing: normals.area_sum === 0 ? spacingOf(positions) : 0,
    ...normals,
  };
}

/** The vertices of triangles, in order; null when they are all. A vertex of none is not drawn. */
function usedVertices(count: number, indices: Indices): Uint32Array | null {
  const isUsed = new Uint8Array(count);
  for (const index of indices) isUsed[index] = 1;
  const used = isUsed.reduce((sum, flag) => sum + flag, 0);
  if (used === count || used === 0) return null;
  const vertices = new Uint32Array(used);
  let to = 0;
  for (let vertex = 0; vertex < count; vertex += 1) if (isUsed[vertex] === 1) vertices[to++] = vertex;
  return vertices;
}

function sphereOf(positions: Float32Array, drawn: Uint32Array | null): Pick<GeometrySummary, 'centre' | 'radius'> {
  const count = drawn?.length ?? positions.length / 3;
  const min: [number, number, number] = [Infinity, Infinity, Infinity];
  const max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < count; i += 1) {
    const at = (drawn === null ? i : drawn[i]!) * 3;
    const x = positions[at]!;
    const y = positions[at + 1]!;
    const z = positions[at + 2]!;
    if (x < min[0]) min[0] = x;
    if (y < min[1]) min[1] = y;
    if (z < min[2]) min[2] = z;
    if (x > max[0]) max[0] = x;
    if (y > max[1]) max[1] = y;
    if (z > max[2]) max[2] = z;
  }
  const centre: [number, number, number] = [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2];
  let radiusSquared = 0;
  for (let i = 0; i < count; i += 1) {
    const at = (drawn === null ? i : drawn[i]!) * 3;
    const dx = positions[at]! - centre[0];
    const dy = positions[at + 1]! - centre[1];
    const dz = positions[at + 2]! - centre[2];
    const d = dx * dx + dy * dy + dz * dz;
    if (d > radiusSquared) radiusSquared = d;
  }
  return { centre, radius: Math.sqrt(radiusSquared) };
}

function normalsOf(positions: Float32Array, indices: Indices | null): Pick<GeometrySummary, 'normal_sum' | 'area_sum'> {
  const normal: [number, number, number] = [0, 0, 0];
  let area = 0;
  for (let i = 0; i < (indices?.length ?? 0); i += 3) {
    const a = indices![i]! * 3;
    const b = indices![i + 1]! * 3;
    const c = indices![i + 2]! * 3;
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    normal[0] += nx;
    normal[1] += ny;
    normal[2] += nz;
    area += Math.sqrt(nx * nx + ny * ny + nz * nz);
  }
  return { normal_sum: normal, area_sum: area };
}

function sampleOf(positions: Float32Array, drawn: Uint32Array | null): Float32Array<ArrayBuffer> {
  const count = drawn?.length ?? positions.length / 3;
  const stride = Math.max(1, Math.ceil(count / SAMPLED_VERTICES));
  const sample = new Float32Array(Math.ceil(count / stride) * 3);
  for (let to = 0, from = 0; to < sample.length; to += 3, from += stride) {
    const at = (drawn === null ? from : drawn[from]!) * 3;
    sample[to] = positions[at]!;
    sample[to + 1] = positions[at + 1]!;
    sample[to + 2] = positions[at + 2]!;
  }
  return sample;
}

/** Median distance of some points to their fourth nearest neighbour; 0 for too few points, and for a single place. */
export function spacingOf(positions: Float32Array): number {
  const count = positions.length / 3;
  if (count <= NEIGHBOUR) return 0;
  const stride = Math.max(1, Math.floor(count / MEASURED_POINTS));
  const distances: number[] = [];
  for (let from = 0; from < count; from += stride) {
    // Squares of the distances to the nearest found so far, ascending.
    const nearest: number[] = [];
    for (let to = 0; to < count; to += 1) {
      if (to === from) continue;
      const dx = positions[to * 3]! - positions[from * 3]!;
      const dy = positions[to * 3 + 1]! - positions[from * 3 + 1]!;
      const dz = positions[to * 3 + 2]! - positions[from * 3 + 2]!;
      const square = dx * dx + dy * dy + dz * dz;
      if (nearest.length === NEIGHBOUR && square >= nearest[NEIGHBOUR - 1]!) continue;
      if (nearest.length === NEIGHBOUR) nearest.pop();
      let place = nearest.length;
      while (place > 0 && nearest[place - 1]! > square) place -= 1;
      nearest.splice(place, 0, square);
    }
    distances.push(Math.sqrt(nearest[NEIGHBOUR - 1]!));
  }
  distances.sort((a, b) => a - b);
  return distances[distances.length >> 1] ?? 0;
}
