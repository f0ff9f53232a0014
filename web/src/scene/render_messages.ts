/** What the page and its drawing side, in a worker of its own where the browser can do that, say to each other. */

import type { Vec3 } from '../protocol/messages';
import type { Ray } from './picking';

/** One tile as it is drawn: metres relative to the scene origin, and a colour per vertex. */
export interface TileArrays {
  positions: Float32Array<ArrayBuffer>;
  /** Null: a point cloud. */
  indices: Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer> | null;
  rgba: Uint8Array<ArrayBuffer>;
  centre: Vec3;
  radius: number;
}

/** A change of what is drawn. Tiles have numbers that the page gives them; a new one is hidden. */
export type RenderCommand =
  | { change: 'create'; tile: number; arrays: TileArrays }
  | { change: 'colours'; tile: number; rgba: Uint8Array<ArrayBuffer> }
  | { change: 'visible'; tile: number; visible: boolean }
  | { change: 'dispose'; tile: number }
  | { change: 'background'; colour: number }
  | { change: 'size'; width: number; height: number; pixel_ratio: number };

/** Column-major, as three.js has them. */
export interface CameraMatrices {
  world_from_camera: number[];
  clip_from_camera: number[];
}

export type RenderRequest =
  | { kind: 'start'; canvas: OffscreenCanvas }
  /** Apply the changes, then draw from this camera; of several that come before the screen takes one, the last is drawn. */
  | { kind: 'picture'; number: number; commands: RenderCommand[]; camera: CameraMatrices }
  | { kind: 'pick'; id: number; ray: Ray; cone: number }
  | { kind: 'copy'; id: number };

/** Objects held on the GPU, and what the last picture drew. */
export interface GpuObjects {
  geometries: number;
  textures: number;
  programs: number;
  triangles: number;
  calls: number;
}

export type RenderReply =
  | { kind: 'failed'; message: string }
  /** Everything up to picture `number` has been drawn. */
  | { kind: 'drawn'; number: number; gpu: GpuObjects }
  | { kind: 'picked'; id: number; distance: number | null }
  | { kind: 'copied'; id: number; picture: ImageBitmap };
