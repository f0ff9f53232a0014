/** Draco payloads to plain arrays. Runs in a worker in the browser, and as it is in tests. */

import type { Decoder, DecoderModule, Mesh, PointCloud } from 'draco3d/draco_decoder_nodejs.js';
import type { ColoursJob, DecodedColours, DecodedGeometry, DecodeJob, DecodeResult, GeometrySummary } from './messages';

/** Most vertices of a geometry in its summary's sample. */
const SAMPLED_VERTICES = 1000;

/** Decodes one job; throws an Error that says what the decoder disliked. */
export function decodeJob(draco: DecoderModule, job: DecodeJob): DecodeResult {
  return job.kind === 'geometry' ? decodeGeometry(draco, job.payload, job.origin_m) : decodeColours(draco, job);
}

function decodeGeometry(draco: DecoderModule, payload: Uint8Array, origin: readonly [number, number, number]): DecodedGeometry {
  const decoder = new draco.Decoder();
  const bytes = new Int8Array(payload.buffer, payload.byteOffset, payload.byteLength);
  const type = decoder.GetEncodedGeometryType(bytes);
  let geometry: Mesh | PointCloud | null = null;
  try {
    if (type === draco.TRIANGULAR_MESH) {
      const mesh = new draco.Mesh();
      geometry = mesh;
      check(decoder.DecodeArrayToMesh(bytes, bytes.byteLength, mesh));
    } else if (type === draco.POINT_CLOUD) {
      const cloud = new draco.PointCloud();
      geometry = cloud;
      check(decoder.DecodeArrayToPointCloud(bytes, bytes.byteLength, cloud));
    } else {
      throw new Error('geometry: not a Draco stream');
    }
    const attributeId = decoder.GetAttributeId(geometry, draco.POSITION);
    if (attributeId < 0) throw new Error('geometry: no POSITION attribute');
    const vertexCount = geometry.num_points();
    const positions = new Float32Array(vertexCount * 3);
    const size = positions.byteLength;
    const heap = draco._malloc(size);
    decoder.GetAttributeDataArrayForAllPoints(
      geometry,
      decoder.GetAttribute(geometry, attributeId),
      draco.DT_FLOAT32,
      size,
      heap,
    );
    positions.set(new Float32Array(draco.HEAPF32.buffer, heap, vertexCount * 3));
    draco._free(heap);
    // Adding the origin here, not in a matrix: a vertex that two tiles share then is the same float in both, and no crack shows.
    for (let i = 0; i < positions.length; i += 3) {
      positions[i] = positions[i]! + origin[0];
      positions[i + 1] = positions[i + 1]! + origin[1];
      positions[i + 2] = positions[i + 2]! + origin[2];
    }
    const indices = type === draco.TRIANGULAR_MESH ? decodeIndices(draco, decoder, geometry as Mesh, vertexCount) : null;
    return { kind: 'geometry', positions, indices, summary: summaryOf(positions, indices) };
  } finally {
    if (geometry !== null) draco.destroy(geometry);
    draco.destroy(decoder);
  }
}

function decodeIndices(draco: DecoderModule, decoder: Decoder, mesh: Mesh, vertexCount: number) {
  const length = mesh.num_faces() * 3;
  const size = length * 4;
  const heap = draco._malloc(size);
  decoder.GetTrianglesUInt32Array(mesh, size, heap);
  const wide = new Uint32Array(draco.HEAPF32.buffer, heap, length);
  const indices = vertexCount <= 65535 ? Uint16Array.from(wide) : wide.slice();
  draco._free(heap);
  return indices as Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer>;
}

function decodeColours(draco: DecoderModule, { payload, transform }: ColoursJob): DecodedColours {
  const decoder = new draco.Decoder();
  const cloud = new draco.PointCloud();
  const bytes = new Int8Array(payload.buffer, payload.byteOffset, payload.byteLength);
  try {
    check(decoder.DecodeArrayToPointCloud(bytes, bytes.byteLength, cloud));
    const rgba = new Uint8Array(cloud.num_points() * 4);
    if (transform === 'none') {
      withBytes(draco, decoder, cloud, draco.COLOR, 3, (rgb) => {
        for (let from = 0, to = 0; to < rgba.length; from += 3, to += 4) {
          rgba[to] = rgb[from]!;
          rgba[to + 1] = rgb[from + 1]!;
          rgba[to + 2] = rgb[from + 2]!;
          rgba[to + 3] = 255;
        }
      });
    } else {
      withBytes(draco, decoder, cloud, draco.COLOR, 1, (green) => {
        for (let from = 0, to = 1; to < rgba.length; from += 1, to += 4) rgba[to] = green[from]!;
      });
      // Sums are stored modulo 256.
      withBytes(draco, decoder, cloud, draco.GENERIC, 2, (differences) => {
        for (let from = 0, to = 0; to < rgba.length; from += 2, to += 4) {
          const green = rgba[to + 1]!;
          rgba[to] = differences[from]! + green;
          rgba[to + 2] = differences[from + 1]! + green;
          rgba[to + 3] = 255;
        }
      });
    }
    return { kind: 'colours', rgba };
  } finally {
    draco.destroy(cloud);
    draco.destroy(decoder);
  }
}

/** Lends an attribute of bytes, in the order of the points. */
function withBytes(
  draco: DecoderModule,
  decoder: Decoder,
  cloud: PointCloud,
  type: number,
  components: number,
  use: (values: Uint8Array) => void,
): void {
  const name = type === draco.COLOR ? 'COLOR' : 'GENERIC';
  const attributeId = decoder.GetAttributeId(cloud, type);
  if (attributeId < 0) throw new Error(`colours: no ${name} attribute`);
  const attribute = decoder.GetAttribute(cloud, attributeId);
  if (attribute.num_components() !== components) {
    throw new Error(`colours: ${attribute.num_components()} components of ${name}, not ${components}`);
  }
  const size = cloud.num_points() * components;
  const heap = draco._malloc(size);
  decoder.GetAttributeDataArrayForAllPoints(cloud, attribute, draco.DT_UINT8, size, heap);
  use(new Uint8Array(draco.HEAPF32.buffer, heap, size));
  draco._free(heap);
}

function check(status: { ok(): boolean; error_msg(): string }): void {
  if (!status.ok()) throw new Error(`Draco: ${status.error_msg()}`);
}

/** The sphere is for culling; sample and normals are for the first view. */
function summaryOf(positions: Float32Array, indices: Uint16Array | Uint32Array | null): GeometrySummary {
  const min: [number, number, number] = [Infinity, Infinity, Infinity];
  const max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    const x = positions[i]!;
    const y = positions[i + 1]!;
    const z = positions[i + 2]!;
    if (x < min[0]) min[0] = x;
    if (y < min[1]) min[1] = y;
    if (z < min[2]) min[2] = z;
    if (x > max[0]) max[0] = x;
    if (y > max[1]) max[1] = y;
    if (z > max[2]) max[2] = z;
  }
  const centre: [number, number, number] = [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2];
  let radiusSquared = 0;
  for (let i = 0; i < positions.length; i += 3) {
    const dx = positions[i]! - centre[0];
    const dy = positions[i + 1]! - centre[1];
    const dz = positions[i + 2]! - centre[2];
    const d = dx * dx + dy * dy + dz * dz;
    if (d > radiusSquared) radiusSquared = d;
  }
  const normal: [number, number, number] = [0, 0, 0];
  let area = 0;
  if (indices !== null) {
    for (let i = 0; i < indices.length; i += 3) {
      const a = indices[i]! * 3;
      const b = indices[i + 1]! * 3;
      const c = indices[i + 2]! * 3;
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
  }
  return {
    vertex_count: positions.length / 3,
    triangle_count: (indices?.length ?? 0) / 3,
    centre,
    radius: Math.sqrt(radiusSquared),
    sample: sampleOf(positions),
    normal_sum: normal,
    area_sum: area,
  };
}

function sampleOf(positions: Float32Array): Float32Array<ArrayBuffer> {
  const vertexCount = positions.length / 3;
  const stride = Math.max(1, Math.ceil(vertexCount / SAMPLED_VERTICES));
  const sample = new Float32Array(Math.ceil(vertexCount / stride) * 3);
  for (let to = 0, from = 0; to < sample.length; to += 3, from += 3 * stride) {
    sample[to] = positions[from]!;
    sample[to + 1] = positions[from + 1]!;
    sample[to + 2] = positions[from + 2]!;
  }
  return sample;
}
