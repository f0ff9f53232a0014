/** What the page and its drawing side, in a worker of its own where the browser can do that, say to each other. */

import type { Vec3 } from '../protocol/messages';
import type { FusionChange } from '../protocol/messages';
import type { SceneFacts } from '../fusion/fusion_module';
import type { SightWish } from './clear_sight';
import type { Ray } from './picking';
import type { Highlighting } from './surface_share';

/** What the sensors saw of a tile, a value per vertex: what it is fused from here. */
export interface RawArrays {
  codes: Uint16Array<ArrayBuffer>;
  scale: number;
  offset: number;
  rgb: Uint8Array<ArrayBuffer>;
}

/** One tile as it is drawn: metres relative to the scene origin, and a colour per vertex. */
export interface TileArrays {
  positions: Float32Array<ArrayBuffer>;
  /** Null: a point cloud. */
  indices: Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer> | null;
  rgba: Uint8Array<ArrayBuffer>;
  centre: Vec3;
  radius: number;
  /** Distance between neighbouring points of a cloud, metres. */
  point_spacing: number;
}

/** A change of what is drawn. Tiles have numbers that the page gives them; a new one is hidden. */
export type RenderCommand =
  | { change: 'create'; tile: number; arrays: TileArrays }
  | { change: 'colours'; tile: number; rgba: Uint8Array<ArrayBuffer> }
  /** Both layers, or the one that has come anew. */
  | { change: 'raw'; tile: number; raw: Partial<RawArrays> }
  /** The library that fuses, compiled. */
  | { change: 'module'; module: WebAssembly.Module }
  | { change: 'facts'; facts: SceneFacts }
  /** From now on tiles with raw arrays show these settings, all in the same picture; null: they keep the colours that they are given. */
  | { change: 'fuse'; settings: FusionChange | null }
  /** How sure its temperatures are, kelvin. */
  | { change: 'sigma'; tile: number; sigma: Pick<RawArrays, 'codes' | 'scale' | 'offset'> }
  /** What is less sure than that is hatched; null: nothing. */
  | { change: 'hatch'; kelvin: number | null }
  | { change: 'visible'; tile: number; visible: boolean }
  | { change: 'dispose'; tile: number }
  | { change: 'background'; colour: number }
  /** Diameter of the points of a cloud in metres; null: as far as they are apart. */
  | { change: 'points'; diameter: number | null }
  /** A line around what is highlighted. */
  | { change: 'outline'; isOn: boolean }
  | { change: 'size'; width: number; height: number; pixel_ratio: number };

/** Where a picture is taken from. */
export interface Eye {
  /** Column-major, as three.js has it. */
  world_from_camera: number[];
  /** Half the picture's width and height at distance 1. */
  tangents: [number, number];
  /** To what is looked at, metres. */
  distance: number;
}

export type RenderRequest =
  | { kind: 'start'; canvas: OffscreenCanvas }
  /** Apply the changes, then draw from there; of several that come before the screen takes one, the last is drawn. `resolution`: share of the screen's, along each side. */
  | { kind: 'picture'; number: number; commands: RenderCommand[]; eye: Eye; resolution: number; isMoving: boolean }
  | { kind: 'pick'; id: number; ray: Ray; cone: number }
  /** Where the target of the wish is seen from. */
  | { kind: 'sight'; id: number; wish: SightWish }
  /** The vertex of what is drawn, and has raw arrays, that is nearest to a point. */
  | { kind: 'probe'; id: number; point: Vec3 }
  /** What of what is drawn is highlighted, where it is fused here. */
  | { kind: 'highlighting'; id: number }
  | { kind: 'copy'; id: number };

/** Objects held on the GPU, and what the last picture drew. */
export interface GpuObjects {
  geometries: number;
  textures: number;
  programs: number;
  triangles: number;
  calls: number;
}

/** What the picture knows of a place by itself. */
export interface ProbedVertex {
  position: Vec3;
  /** degC; infinite beyond the sensor's range, NaN where nothing was measured. */
  temperature: number;
  visible: Vec3;
  fused: Vec3;
  distance: number;
}

export type RenderReply =
  | { kind: 'failed'; message: string }
  /** Everything up to picture `number` has been drawn; the last one took so long. */
  | { kind: 'drawn'; number: number; gpu: GpuObjects; ms: number }
  | { kind: 'picked'; id: number; distance: number | null }
  /** Null where not all is fused here. */
  | { kind: 'highlighting'; id: number; found: Highlighting | null }
  | { kind: 'probed'; id: number; vertex: ProbedVertex | null }
  /** The library that fuses is ready. */
  | { kind: 'can_fuse' }
  /** Fusing here has failed; what was fused so far stands. */
  | { kind: 'not_fused'; message: string }
  | { kind: 'sighted'; id: number; eye: Vec3 | null }
  /** Null: there is none, for the GPU is away. */
  | { kind: 'copied'; id: number; picture: ImageBitmap | null }
  /** The browser has taken the GPU away, or given it back. */
  | { kind: 'context'; isLost: boolean };
