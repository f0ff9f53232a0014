/** Tile frames: the binary messages of docs/protocol.md. */

export const FRAME_MAGIC = 0x31435053;
/** The shortest header; from 80 on it states the errors of colour and temperature too. */
export const FRAME_HEADER_BYTES = 72;

export const FrameKind = {
  geometry: 1,
  colours: 2,
  remove: 3,
  temperature: 4,
  visible: 5,
  colours_subtract_green: 6,
  visible_subtract_green: 7,
} as const;

export interface TileId {
  level: number;
  x: number;
  y: number;
  z: number;
}

export interface TileFrame {
  /** One of FrameKind, or a number this client does not know and ignores. */
  kind: number;
  child_mask: number;
  sequence: number;
  generation: number;
  tile: TileId;
  revision: number;
  vertex_count: number;
  origin_m: [number, number, number];
  position_step_m: number;
  geometric_error_m: number;
  /** NaN = no temperature under this tile. */
  lowest_celsius: number;
  highest_celsius: number;
  /** Largest difference of a channel between the tile and the full mesh, 95th percentile, levels; NaN = not said. */
  colour_error_levels: number;
  /** The same of the temperature; NaN = none, or not said. */
  temperature_error_celsius: number;
  /** A view into the message, not a copy. */
  payload: Uint8Array<ArrayBuffer>;
}

/** A name for maps. */
export function tileKey(id: TileId): string {
  return `${id.level}/${id.x}/${id.y}/${id.z}`;
}

/** Child `octant` (x + 2y + 4z) of a tile. */
export function childTile(id: TileId, octant: number): TileId {
  return {
    level: id.level + 1,
    x: id.x * 2 + (octant & 1),
    y: id.y * 2 + ((octant >> 1) & 1),
    z: id.z * 2 + ((octant >> 2) & 1),
  };
}

/** The tile one level coarser; the root has none. */
export function parentTile(id: TileId): TileId | null {
  if (id.level === 0) return null;
  return { level: id.level - 1, x: Math.floor(id.x / 2), y: Math.floor(id.y / 2), z: Math.floor(id.z / 2) };
}

/** Reads a binary message; throws an Error that says what is wrong with it. */
export function decodeTileFrame(message: ArrayBuffer): TileFrame {
  if (message.byteLength < FRAME_HEADER_BYTES) {
    throw new Error(`tile frame: ${message.byteLength} bytes are fewer than the header's ${FRAME_HEADER_BYTES}`);
  }
  const view = new DataView(message);
  const u32 = (offset: number) => view.getUint32(offset, true);
  const f32 = (offset: number) => view.getFloat32(offset, true);
  if (u32(0) !== FRAME_MAGIC) throw new Error(`tile frame: magic 0x${u32(0).toString(16)} is not 0x31435053`);
  const headerSize = view.getUint16(6, true);
  if (headerSize < FRAME_HEADER_BYTES || headerSize > message.byteLength) {
    throw new Error(`tile frame: header size ${headerSize} is outside 72..${message.byteLength}`);
  }
  const payloadSize = u32(68);
  if (payloadSize !== message.byteLength - headerSize) {
    throw new Error(`tile frame: payload of ${message.byteLength - headerSize} bytes, the header says ${payloadSize}`);
  }
  return {
    kind: view.getUint8(4),
    child_mask: view.getUint8(5),
    sequence: u32(8),
    generation: u32(12),
    tile: { level: view.getUint8(16), x: u32(20), y: u32(24), z: u32(28) },
    revision: u32(32),
    vertex_count: u32(36),
    origin_m: [f32(40), f32(44), f32(48)],
    position_step_m: f32(52),
    geometric_error_m: f32(56),
    lowest_celsius: f32(60),
    highest_celsius: f32(64),
    colour_error_levels: headerSize >= 80 ? f32(72) : Number.NaN,
    temperature_error_celsius: headerSize >= 80 ? f32(76) : Number.NaN,
    payload: new Uint8Array(message, headerSize, payloadSize),
  };
}
