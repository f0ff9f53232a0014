/** Draco payloads to plain arrays. Runs in a worker in the browser, and as it is in tests. */

import type { Attribute, Decoder, DecoderModule, Mesh, PointCloud } from 'draco3d/draco_decoder_nodejs.js';
import type {
  ColoursJob,
  DecodedColours,
  DecodedGeometry,
  DecodedTemperature,
  DecodedVisible,
  DecodeJob,
  DecodeResult,
  VisibleJob,
} from './messages';
import { summaryOf } from './summary';

/** Decodes one job; throws an Error that says what the decoder disliked. */
export function decodeJob(draco: DecoderModule, job: DecodeJob): DecodeResult {
  switch (job.kind) {
    case 'geometry':
      return decodeGeometry(draco, job.payload, job.origin_m);
    case 'colours':
      return decodeColours(draco, job);
    case 'visible':
      return decodeVisible(draco, job);
    case 'temperature':
      return decodeTemperature(draco, job.payload);
    case 'sigma':
      return { ...decodeTemperature(draco, job.payload), kind: 'sigma' };
  }
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
    withMarks(draco, decoder, cloud, (marks) => {
      for (let from = 0, to = 3; to < rgba.length; from += 1, to += 4) rgba[to] = marks[from] === 0 ? 255 : 0;
    });
    return { kind: 'colours', rgba };
  } finally {
    draco.destroy(cloud);
    draco.destroy(decoder);
  }
}

function decodeVisible(draco: DecoderModule, { payload, transform }: VisibleJob): DecodedVisible {
  const { rgba } = decodeColours(draco, { kind: 'colours', payload, transform });
  const rgb = new Uint8Array((rgba.length / 4) * 3);
  for (let from = 0, to = 0; to < rgb.length; from += 4, to += 3) {
    rgb[to] = rgba[from]!;
    rgb[to + 1] = rgba[from + 1]!;
    rgb[to + 2] = rgba[from + 2]!;
  }
  return { kind: 'visible', rgb };
}

/** Scale and offset stand before the Draco stream. */
const TABLE_BYTES = 8;

function decodeTemperature(draco: DecoderModule, payload: Uint8Array): DecodedTemperature {
  if (payload.byteLength <= TABLE_BYTES) throw new Error('temperature: no scale and offset before the codes');
  const table = new DataView(payload.buffer, payload.byteOffset, TABLE_BYTES);
  const scale = table.getFloat32(0, true);
  const offset = table.getFloat32(4, true);
  if (!(scale > 0) || !Number.isFinite(scale) || !Number.isFinite(offset)) {
    throw new Error(`temperature: a scale of ${scale} and an offset of ${offset} are no temperatures`);
  }
  const decoder = new draco.Decoder();
  const cloud = new draco.PointCloud();
  const bytes = new Int8Array(payload.buffer, payload.byteOffset + TABLE_BYTES, payload.byteLength - TABLE_BYTES);
  try {
    check(decoder.DecodeArrayToPointCloud(bytes, bytes.byteLength, cloud));
    const attributeId = decoder.GetAttributeId(cloud, draco.GENERIC);
    if (attributeId < 0) throw new Error('temperature: no GENERIC attribute');
    const attribute = decoder.GetAttribute(cloud, attributeId);
    if (attribute.num_components() !== 1) throw new Error(`temperature: ${attribute.num_components()} components, not 1`);
    const count = cloud.num_points();
    const heap = draco._malloc(2 * count);
    decoder.GetAttributeDataArrayForAllPoints(cloud, attribute, draco.DT_UINT16, 2 * count, heap);
    const codes = new Uint16Array(draco.HEAPF32.buffer, heap, count).slice();
    draco._free(heap);
    return { kind: 'temperature', codes, scale, offset };
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
  lend(draco, decoder, cloud, attribute, use);
}

/** Lends the marks beside colours, where there are any: the last attribute, of one byte. */
function withMarks(draco: DecoderModule, decoder: Decoder, cloud: PointCloud, use: (marks: Uint8Array) => void): void {
  const last = decoder.GetAttribute(cloud, cloud.num_attributes() - 1);
  if (last.attribute_type() === draco.GENERIC && last.num_components() === 1) lend(draco, decoder, cloud, last, use);
}

function lend(
  draco: DecoderModule,
  decoder: Decoder,
  cloud: PointCloud,
  attribute: Attribute,
  use: (values: Uint8Array) => void,
): void {
  const size = cloud.num_points() * attribute.num_components();
  const heap = draco._malloc(size);
  decoder.GetAttributeDataArrayForAllPoints(cloud, attribute, draco.DT_UINT8, size, heap);
  use(new Uint8Array(draco.HEAPF32.buffer, heap, size));
  draco._free(heap);
}

function check(status: { ok(): boolean; error_msg(): string }): void {
  if (!status.ok()) throw new Error(`Draco: ${status.error_msg()}`);
}
