/** Tile frames: the binary messages of docs/protocol.md. */

import { FRAME_HEADER_BYTES, FRAME_MAGIC, HEADER_SIZE_OFFSET, readHeader, type TileFrameHeader } from './generated_frame';

export { FrameKind } from './generated_frame';

export interface TileId {
  level: number;
  x: number;
  y: number;
  z: number;
}

/** Its kind is one of FrameKind, or a number this client does not know and ignores. */
export interface TileFrame extends Omit<TileFrameHeader, 'payload_size_bytes'> {
  /** Of the whole message. */
  bytes: number;
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
  const magic = view.getUint32(0, true);
  if (magic !== FRAME_MAGIC) throw new Error(`tile frame: magic 0x${magic.toString(16)} is not 0x${FRAME_MAGIC.toString(16)}`);
  const size = view.getUint16(HEADER_SIZE_OFFSET, true);
  if (size < FRAME_HEADER_BYTES || size > message.byteLength) {
    throw new Error(`tile frame: header size ${size} is outside ${FRAME_HEADER_BYTES}..${message.byteLength}`);
  }
  const { payload_size_bytes, ...header } = readHeader(view, size);
  if (payload_size_bytes !== message.byteLength - size) {
    throw new Error(`tile frame: payload of ${message.byteLength - size} bytes, the header says ${payload_size_bytes}`);
  }
  return { ...header, bytes: message.byteLength, payload: new Uint8Array(message, size, payload_size_bytes) };
}
