// What the tests of this folder share: tiles as they come from the wire and from the decoder.
import type { DecodedGeometry } from '../decode/messages';
import { FrameKind, type TileFrame, type TileId } from '../protocol/frame';

export const ROOT: TileId = { level: 0, x: 0, y: 0, z: 0 };

/** One triangle; or, of fewer than three vertices, points. */
export function decodedGeometry(vertices = 1): DecodedGeometry {
  const hasTriangle = vertices >= 3;
  return {
    kind: 'geometry',
    positions: new Float32Array(vertices * 3),
    indices: hasTriangle ? Uint16Array.from([0, 1, 2]) : null,
    summary: {
      vertex_count: vertices,
      triangle_count: hasTriangle ? 1 : 0,
      centre: [0, 0, 0],
      radius: 1,
      sample: new Float32Array(3),
      point_spacing: 0,
      normal_sum: [0, 0, hasTriangle ? 1 : 0],
      area_sum: hasTriangle ? 1 : 0,
    },
  };
}

export function tileFrame(tile: TileId, part: Partial<TileFrame> = {}): TileFrame {
  return {
    kind: FrameKind.colours,
    child_mask: 0,
    sequence: 1,
    generation: 1,
    tile,
    revision: 1,
    vertex_count: 1,
    origin_m: [0, 0, 0],
    position_step_m: 1,
    geometric_error_m: 0,
    colour_error_levels: 0,
    temperature_error_celsius: 0,
    lowest_celsius: 0,
    highest_celsius: 0,
    bytes: 100,
    payload: new Uint8Array(0),
    ...part,
  };
}
