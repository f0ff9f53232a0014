/** Made by protocol/generate from protocol/schema/tile_frame.json. Not to be edited. */

import type { TileId } from './frame';

export const FRAME_MAGIC = 0x31435053;
/** The shortest header; what was added later stands behind it. */
export const FRAME_HEADER_BYTES = 72;
export const HEADER_SIZE_OFFSET = 6;

export const FrameKind = {
  geometry: 1,
  colours: 2,
  remove: 3,
  temperature: 4,
  visible: 5,
  colours_subtract_green: 6,
  visible_subtract_green: 7,
  temperature_sigma: 8,
} as const;

export interface TileFrameHeader {
  /**
   * 1 geometry, 2 colours, 3 remove, 4 temperature, 5 visible, 6 colours_subtract_green, 7 visible_subtract_green, 8
   * temperature_sigma; a reader ignores others.
   */
  kind: number;
  /** Bit i set = child octant i (x + 2y + 4z) exists. */
  child_mask: number;
  /** +1 per frame on this connection, from 1. */
  sequence: number;
  /** Of the fusion settings that the colours show; 0 where it means nothing. */
  generation: number;
  /** Level, zero, x, y, z; level 0 = root = coarsest; child i of (l,x,y,z) = (l+1, 2x+(i&1), 2y+(i>>1&1), 2z+(i>>2)). */
  tile: TileId;
  /** Of the tile's geometry. */
  revision: number;
  vertex_count: number;
  /** Tile origin, metres, relative to the scene origin. */
  origin_m: [number, number, number];
  /** Metres; the largest error per axis is half of it. */
  position_step_m: number;
  /** Against the full mesh, metres; 0 at leaves. */
  geometric_error_m: number;
  /** Lowest temperature under this tile, degC; NaN = none, infinite = beyond the sensor's range. */
  lowest_celsius: number;
  /** The highest. */
  highest_celsius: number;
  payload_size_bytes: number;
  /**
   * Largest difference of a channel between the tile's visible colours and the full mesh under it, 95th percentile of the
   * tile, or of that eighth or 64th of its box (with at least a 32nd of its surface) where it is the largest, levels; 0 at
   * leaves; 255 where a map has grown and the tile that shows what was there before is not made anew yet. NaN where the
   * sender did not say.
   */
  colour_error_levels: number;
  /** The same in degC; 0 at leaves; NaN = no temperature. NaN where the sender did not say. */
  temperature_error_celsius: number;
}

/** The header that a message begins with; the caller has checked that there are `size` bytes, and that a header has so many. */
export function readHeader(view: DataView, size: number): TileFrameHeader {
  const u32 = (offset: number) => view.getUint32(offset, true);
  const f32 = (offset: number) => view.getFloat32(offset, true);
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
    payload_size_bytes: u32(68),
    colour_error_levels: size >= 76 ? f32(72) : Number.NaN,
    temperature_error_celsius: size >= 80 ? f32(76) : Number.NaN,
  };
}
