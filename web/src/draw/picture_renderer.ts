import {
  BufferAttribute,
  BufferGeometry,
  ColorManagement,
  LinearSRGBColorSpace,
  Matrix4,
  Mesh,
  PerspectiveCamera,
  Points,
  Scene,
  Sphere,
  Vector3,
  type RawShaderMaterial,
  WebGLRenderer,
  WebGLRenderTarget,
} from 'three';
import type { SceneFacts } from '../fusion/fusion_module';
import type { FusionChange, Vec3 } from '../protocol/messages';
import { clearSight } from './clear_sight';
import { celsiusOf } from './codes';
import { depthRange } from './depth_range';
import { Outline } from './outline';
import { PictureBuffer } from './picture_buffer';
import { nearestHit } from './picking';
import { type Highlighting, SurfaceShare, vertexAreas } from './surface_share';
import type {
  Eye,
  GpuObjects,
  ProbedVertex,
  RawArrays,
  RenderCommand,
  RenderReply,
  RenderRequest,
  TileArrays,
} from './render_messages';
import { sigmaStep } from './sigma_steps';
import { SlicePace, Slices } from './slices';
import type { TileFuser } from './tile_fuser';
import { TileMaterials } from './tile_materials';

// Colours are sRGB bytes made by the server; nothing may convert them on their way to the screen.
ColorManagement.enabled = false;

const FENCE_INTERVAL_MS = 3;
const FUSED_MEASURE = 'tiles fused';
/** Samples a pixel of a picture at rest; one while the camera moves at less than the screen's resolution. */
const SAMPLES = 4;

interface Tile {
  /** Visible only while it is being drawn. */
  object: Mesh | Points;
  isShown: boolean;
  colours: BufferAttribute;
  raw: RawArrays | null;
  /** Colours that came while others were made here: those of the robot's settings, or of settings of before. */
  arrived: Uint8Array | null;
  /** Number of the settings that its colours were fused with here; 0: they came as they are. */
  fusedWith: number;
  arrays: Omit<TileArrays, 'rgba'>;
  /** What each vertex stands for, once it was asked for. */
  areas: Float32Array | null;
}

/** A picture that is being drawn. */
interface Picture {
  number: number;
  start: number;
  buffer: PictureBuffer;
  tiles: Tile[];
  slices: Slices;
  isInParts: boolean;
  /** What is drawn now is drawn within a frame of the browser's. */
  isInFrame: boolean;
}

function showColours(tile: Tile, rgba: Uint8Array): void {
  tile.colours.array = rgba;
  tile.colours.needsUpdate = true;
  tile.arrived = null;
  tile.fusedWith = 0;
}

/** Draws pictures on a canvas. It owns everything that is on the GPU; the page tells it what to draw by messages. */
export class PictureRenderer {
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera();
  readonly #materials = new TileMaterials();
  readonly #tiles = new Map<number, Tile>();
  #eye: Eye = { world_from_camera: new Matrix4().toArray(), tangents: [1, 1], distance: 1 };
  #background = 0;
  #size: [number, number] = [1, 1];
  #fullPixelRatio = 1;
  #resolution = 1;
  /** Drawn in parts, so that input gets in between: at rest. While the camera moves the newest picture is wanted at once. */
  #isInParts = false;
  readonly #slicePace = new SlicePace();
  /** For pictures in full, and for those while the camera moves. */
  #buffers: { full: PictureBuffer | null; coarse: PictureBuffer | null } = { full: null, coarse: null };
  /** Made when it is first wanted. */
  #outline: Outline | null = null;
  #isOutlined = false;
  /** The shaders of every material are. */
  #isCompiled = false;
  /** Under way; a newer one takes its place. */
  #picture: Picture | null = null;
  #pointDiameter: number | null = null;
  #fuser: TileFuser | null = null;
  #facts: SceneFacts | null = null;
  /** Of the settings that tiles are fused with here; 0: none. */
  #fusing = 0;
  #settingsCount = 0;
  #frame = 0;
  #newest = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement | OffscreenCanvas,
    private readonly reply: (message: RenderReply, transfer?: Transferable[]) => void,
  ) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: false, depth: false, powerPreference: 'high-performance' });
    this.#renderer.autoClear = false;
    this.#renderer.info.autoReset = false;
    this.#renderer.debug.checkShaderErrors = import.meta.env.DEV;
    this.#renderer.outputColorSpace = LinearSRGBColorSpace;
    this.#scene.matrixAutoUpdate = false;
    this.#camera.matrixAutoUpdate = false;
    this.#drawSpecimens([this.#materials.surface]);
    canvas.addEventListener('webglcontextlost', () => this.reply({ kind: 'context', isLost: true }));
    // The renderer makes its objects anew from the arrays as they are drawn.
    canvas.addEventListener('webglcontextrestored', () => {
      // What it held went with the context.
      this.#buffers = { full: null, coarse: null };
      this.#outline = null;
      // Only with a picture on it is the canvas shown again.
      this.#drawWhole();
      this.reply({ kind: 'context', isLost: false });
    });
  }

  /** For tests, which take it away. */
  get context(): WebGL2RenderingContext {
    return this.#renderer.getContext() as WebGL2RenderingContext;
  }

  handle(request: Exclude<RenderRequest, { kind: 'start' }>): void {
    switch (request.kind) {
      case 'picture':
        this.#eye = request.eye;
        for (const command of request.commands) this.#apply(command);
        this.#fuseTiles(({ isShown }) => isShown);
        this.#newest = request.number;
        this.#resolution = request.resolution;
        this.#isInParts = !request.isMoving;
        this.#drawSoon();
        break;
      case 'pick':
        this.reply({ kind: 'picked', id: request.id, distance: nearestHit(this.#drawn(), request.ray, request.cone) });
        break;
      case 'sight':
        this.reply({ kind: 'sighted', id: request.id, eye: clearSight(this.#drawn(), request.wish) });
        break;
      case 'probe':
        this.reply({ kind: 'probed', id: request.id, vertex: this.#nearestVertex(request.point) });
        break;
      case 'highlighting':
        this.reply({ kind: 'highlighting', id: request.id, found: this.#highlighting() });
        break;
      case 'copy':
        void this.#copy(request.id);
    }
  }

  dispose(): void {
    if (this.#frame !== 0) cancelAnimationFrame(this.#frame);
    for (const tile of [...this.#tiles.keys()]) this.#apply({ change: 'dispose', tile });
    this.#materials.dispose();
    this.#outline?.dispose();
    this.#renderer.dispose();
  }

  #apply(command: RenderCommand): void {
    switch (command.change) {
      case 'create':
        this.#tiles.set(command.tile, this.#create(command.arrays));
        break;
      case 'colours': {
        const tile = this.#tiles.get(command.tile);
        if (tile === undefined) break;
        if (this.#fusing !== 0 && tile.raw !== null) tile.arrived = command.rgba;
        else showColours(tile, command.rgba);
        break;
      }
      case 'raw': {
        const tile = this.#tiles.get(command.tile);
        if (tile === undefined) break;
        tile.raw = { ...tile.raw, ...command.raw } as RawArrays;
        tile.fusedWith = 0;
        break;
      }
      case 'sigma': {
        const { sigma } = command;
        const steps = Uint8Array.from(sigma.codes, (code) => sigmaStep(celsiusOf(code, sigma)));
        this.#tiles.get(command.tile)?.object.geometry.setAttribute('sigma', new BufferAttribute(steps, 1, true));
        break;
      }
      case 'hatch':
        this.#materials.setHatch(command.kelvin);
        break;
      case 'module':
        this.#load(command.module);
        break;
      case 'facts':
        this.#facts = command.facts;
        this.#orSay(() => this.#fuser?.setFacts(command.facts));
        break;
      case 'fuse': {
        const { settings } = command;
        if (settings === null) {
          // Hidden tiles, too, keep what was set last.
          this.#fuseTiles(() => true);
          this.#stopFusing();
          break;
        }
        // What came before is of other settings.
        for (const tile of this.#tiles.values()) tile.arrived = null;
        this.#orSay(() => this.#useSettings(settings));
        break;
      }
      case 'visible': {
        const tile = this.#tiles.get(command.tile);
        if (tile !== undefined) tile.isShown = command.visible;
        break;
      }
      case 'dispose': {
        const tile = this.#tiles.get(command.tile);
        if (tile === undefined) break;
        this.#scene.remove(tile.object);
        tile.object.geometry.dispose();
        this.#tiles.delete(command.tile);
        break;
      }
      case 'background':
        this.#background = command.colour;
        break;
      case 'points':
        this.#pointDiameter = command.diameter;
        break;
      case 'outline':
        if (this.#isOutlined !== command.isOn) for (const tile of this.#tiles.values()) tile.fusedWith = 0;
        this.#isOutlined = command.isOn;
        this.#materials.setOutlined(command.isOn);
        break;
      case 'size':
        this.#fullPixelRatio = command.pixel_ratio;
        this.#size = [command.width, command.height];
    }
  }

  /** The library that fuses, which the first pictures do without. */
  #load(module: WebAssembly.Module): void {
    import('./tile_fuser')
      .then(({ TileFuser }) => {
        this.#fuser = new TileFuser(module);
        if (this.#facts !== null) this.#fuser.setFacts(this.#facts);
        this.reply({ kind: 'can_fuse' });
      })
      .catch((error: unknown) => this.#cannotFuse(error));
  }

  #useSettings(settings: FusionChange): void {
    if (this.#fuser === null) throw new Error('the library is not there');
    this.#fuser.setSettings(settings);
    this.#settingsCount += 1;
    this.#fusing = this.#settingsCount;
  }

  /** Tiles that are seen change all in the same picture, those that are not when they are. */
  #fuseTiles(isWanted: (tile: Tile) => boolean): void {
    const fuser = this.#fuser;
    if (this.#fusing === 0 || fuser === null) return;
    const start = performance.now();
    let count = 0;
    this.#orSay(() => {
      for (const tile of this.#tiles.values()) {
        if (tile.raw === null || tile.fusedWith === this.#fusing || !isWanted(tile)) continue;
        count += 1;
        fuser.fuse(tile.raw, tile.colours.array as Uint8Array, this.#isOutlined);
        tile.colours.needsUpdate = true;
        tile.fusedWith = this.#fusing;
      }
    });
    if (count === 0) return;
    // The last one, for the browser's tools and tests/bench/fusion/browser_bench.mjs.
    performance.clearMeasures(FUSED_MEASURE);
    performance.measure(FUSED_MEASURE, { start });
  }

  #orSay(act: () => void): void {
    try {
      act();
    } catch (error) {
      this.#cannotFuse(error);
    }
  }

  #stopFusing(): void {
    this.#fusing = 0;
    for (const tile of this.#tiles.values()) if (tile.arrived !== null) showColours(tile, tile.arrived);
  }

  #cannotFuse(error: unknown): void {
    this.#stopFusing();
    this.reply({ kind: 'not_fused', message: error instanceof Error ? error.message : String(error) });
  }

  #nearestVertex([x, y, z]: Vec3): ProbedVertex | null {
    let least = Infinity;
    let found: { tile: Tile; raw: RawArrays; vertex: number } | null = null;
    for (const tile of this.#tiles.values()) {
      const { raw } = tile;
      if (!tile.isShown || raw === null) continue;
      const { positions, centre, radius } = tile.arrays;
      const away = Math.hypot(centre[0] - x, centre[1] - y, centre[2] - z) - radius;
      if (away > 0 && away * away > least) continue;
      for (let i = 0, vertex = 0; i < positions.length; i += 3, vertex += 1) {
        const dx = positions[i]! - x;
        const dy = positions[i + 1]! - y;
        const dz = positions[i + 2]! - z;
        const square = dx * dx + dy * dy + dz * dz;
        if (square >= least) continue;
        least = square;
        found = { tile, raw, vertex };
      }
    }
    if (found === null) return null;
    const { tile, raw, vertex } = found;
    const triple = (array: ArrayLike<number>, at: number): Vec3 => [array[at]!, array[at + 1]!, array[at + 2]!];
    return {
      position: triple(tile.arrays.positions, 3 * vertex),
      temperature: celsiusOf(raw.codes[vertex]!, raw),
      visible: triple(raw.rgb, 3 * vertex),
      fused: triple(tile.colours.array, 4 * vertex),
      distance: Math.sqrt(least),
    };
  }

  #highlighting(): Highlighting | null {
    const fuser = this.#fuser;
    if (this.#fusing === 0 || fuser === null) return null;
    const tiles = [...this.#tiles.values()].filter(({ isShown }) => isShown);
    const sum = new SurfaceShare(tiles.reduce((count, { arrays }) => count + arrays.positions.length / 3, 0));
    for (const tile of tiles) {
      if (tile.raw === null) return null;
      tile.areas ??= vertexAreas(tile.arrays);
      let marked = tile.colours.array;
      if (!this.#isOutlined || tile.fusedWith !== this.#fusing) {
        const scratch = new Uint8Array(4 * tile.areas.length);
        try {
          fuser.fuse(tile.raw, scratch, true);
        } catch {
          return null;
        }
        marked = scratch;
      }
      sum.add(tile.areas, marked);
    }
    return sum.found;
  }

  #drawn(): Tile['arrays'][] {
    return [...this.#tiles.values()].filter(({ isShown }) => isShown).map(({ arrays }) => arrays);
  }

  #create(arrays: TileArrays): Tile {
    const { positions, indices, rgba, centre, radius, point_spacing } = arrays;
    const geometry = new BufferGeometry();
    const colours = new BufferAttribute(rgba, 4, true);
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', colours);
    if (indices !== null) geometry.setIndex(new BufferAttribute(indices, 1));
    geometry.boundingSphere = new Sphere(new Vector3(...centre), radius);
    const object = indices === null ? new Points(geometry, this.#materials.cloud) : new Mesh(geometry, this.#materials.surface);
    if (indices === null) {
      object.onBeforeRender = () =>
        this.#materials.setPoints(this.#pointDiameter ?? point_spacing, positions.length / 3, this.#pixelRatio);
    }
    object.matrixAutoUpdate = false;
    object.visible = false;
    this.#scene.add(object);
    return {
      object,
      isShown: false,
      colours,
      raw: null,
      arrived: null,
      fusedWith: 0,
      arrays: { positions, indices, centre, radius, point_spacing },
      areas: null,
    };
  }

  /** Draws an empty tile with each of these materials, so that their shaders are compiled before the first real one comes. */
  #drawSpecimens(materials: RawShaderMaterial[]): void {
    const specimen = {
      rgba: new Uint8Array(12),
      positions: new Float32Array(9),
      centre: [0, 0, 0],
      radius: 1,
      point_spacing: 1,
    } satisfies Partial<TileArrays>;
    // A point of a specimen may be seen: not on the canvas, and not in a picture that is under way.
    const target = new WebGLRenderTarget(1, 1);
    this.#renderer.setRenderTarget(target);
    for (const indices of [Uint16Array.from([0, 0, 0]), null]) {
      const { object } = this.#create({ ...specimen, indices });
      object.visible = true;
      object.frustumCulled = false;
      for (const material of materials) {
        if ((material.defines['POINTS'] !== undefined) !== (indices === null)) continue;
        object.material = material;
        this.#renderer.render(this.#scene, this.#camera);
      }
      this.#scene.remove(object);
      object.geometry.dispose();
    }
    this.#renderer.setRenderTarget(null);
    target.dispose();
  }

  /** What the first picture of most scenes does not need is compiled when that stands, before it is needed. */
  #compileRest(): void {
    if (this.#isCompiled) return;
    this.#isCompiled = true;
    this.#drawSpecimens(this.#materials.all);
  }

  #drawSoon(): void {
    this.#picture = null;
    if (this.#frame !== 0) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      this.#picture = this.#begin();
      this.#goOn(this.#picture);
    });
  }

  /** Draws the next part, or all in one, and shows the picture when it is complete: in a frame, for the browser takes it from there. */
  #goOn(picture: Picture): void {
    const start = performance.now();
    const budget = picture.isInParts ? this.#slicePace.budget : Infinity;
    const count = this.#drawPart(picture, budget);
    const isShown = picture.slices.isDone && picture.isInFrame;
    if (isShown) this.#finish(picture);
    this.#afterGpu(() => {
      if (picture.isInParts) this.#slicePace.took(count, performance.now() - start);
      if (isShown) return;
      if (picture !== this.#picture) return;
      picture.isInFrame = false;
      if (!picture.slices.isDone) this.#goOn(picture);
      else
        requestAnimationFrame(() => {
          if (picture === this.#picture) this.#finish(picture);
        });
    });
  }

  #finish(picture: Picture): void {
    this.#show(picture);
    this.#afterGpu(() => {
      const ms = performance.now() - picture.start;
      if (picture.tiles.length > 0) this.#compileRest();
      this.reply({ kind: 'drawn', number: picture.number, gpu: this.#gpuObjects, ms });
    });
  }

  #begin(): Picture {
    const buffer = this.#bufferFor(this.#resolution);
    const tiles = this.#lookFrom(this.#eye, buffer.height);
    this.#renderer.info.reset();
    this.#renderer.setRenderTarget(buffer.target);
    this.#renderer.setClearColor(this.#background, 1);
    this.#renderer.clear();
    const slices = new Slices(tiles.map(({ arrays }) => (arrays.indices ?? arrays.positions).length / 3));
    return { number: this.#newest, start: performance.now(), buffer, tiles, slices, isInParts: this.#isInParts, isInFrame: true };
  }

  /** Returns how many triangles, or points, it has drawn. */
  #drawPart({ buffer, tiles, slices }: Picture, budget: number): number {
    const parts = slices.next(budget);
    for (const { object: index, start, count } of parts) {
      const { object, arrays } = tiles[index]!;
      object.visible = true;
      const corners = arrays.indices === null ? 1 : 3;
      object.geometry.setDrawRange(start * corners, count * corners);
    }
    this.#renderer.setRenderTarget(buffer.target);
    this.#renderer.render(this.#scene, this.#camera);
    for (const { object: index } of parts) tiles[index]!.object.visible = false;
    return parts.reduce((sum, { count }) => sum + count, 0);
  }

  #show({ buffer }: Picture): void {
    if (this.canvas.width !== buffer.width) this.canvas.width = buffer.width;
    if (this.canvas.height !== buffer.height) this.canvas.height = buffer.height;
    if (this.#isOutlined) this.#outline ??= new Outline(this.context);
    buffer.present(this.#isOutlined ? this.#outline : null, buffer.width / this.#size[0]);
  }

  #drawWhole(): void {
    this.#picture = null;
    const picture = this.#begin();
    this.#drawPart(picture, Infinity);
    this.#show(picture);
  }

  get #pixelRatio(): number {
    return this.#fullPixelRatio * this.#resolution;
  }

  #bufferFor(resolution: number): PictureBuffer {
    const kind = resolution < 1 ? 'coarse' : 'full';
    const [width, height] = this.#size.map((side) => Math.max(1, Math.floor(side * this.#pixelRatio))) as [number, number];
    const known = this.#buffers[kind];
    if (known?.width === width && known.height === height) return known;
    known?.dispose();
    const buffer = new PictureBuffer(this.#renderer, width, height, kind === 'full' ? SAMPLES : 1);
    this.#buffers[kind] = buffer;
    return buffer;
  }

  /** Once the GPU is through with what it has been given, so that a slow one is not given more and more. */
  #afterGpu(next: () => void): void {
    const gl = this.context;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const check = () => {
      const isDone = fence === null || gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
      if (!isDone) {
        setTimeout(check, FENCE_INTERVAL_MS);
        return;
      }
      gl.deleteSync(fence);
      next();
    };
    check();
  }

  /** The planes of near and far follow what is drawn, and with them the way in which depth is kept. Returns the tiles that are shown. */
  #lookFrom({ world_from_camera, tangents, distance }: Eye, height: number): Tile[] {
    const shown = [...this.#tiles.values()].filter(({ isShown }) => isShown);
    const m = world_from_camera;
    const eye: Vec3 = [m[12]!, m[13]!, m[14]!];
    const range = depthRange(
      eye,
      [-m[8]!, -m[9]!, -m[10]!],
      distance,
      shown.map(({ arrays }) => arrays),
    );
    const [right, top] = tangents;
    const { near, far } = range;
    this.#camera.matrix.fromArray(m);
    this.#camera.matrixWorldNeedsUpdate = true;
    this.#camera.projectionMatrix.makePerspective(-right * near, right * near, top * near, -top * near, near, far);
    this.#camera.projectionMatrixInverse.copy(this.#camera.projectionMatrix).invert();
    this.#materials.lookFrom(eye, range, height / (2 * top), this.#pixelRatio);
    const { surface, cloud } = this.#materials;
    for (const { object, arrays } of shown) object.material = arrays.indices === null ? cloud : surface;
    return shown;
  }

  async #copy(id: number): Promise<void> {
    if (this.context.isContextLost()) {
      this.reply({ kind: 'copied', id, picture: null });
      return;
    }
    // The canvas holds the picture only until the task that drew it ends.
    this.#drawWhole();
    const picture = await createImageBitmap(this.canvas).catch(() => null);
    this.reply({ kind: 'copied', id, picture }, picture === null ? [] : [picture]);
  }

  get #gpuObjects(): GpuObjects {
    const { memory, programs, render } = this.#renderer.info;
    return {
      geometries: memory.geometries,
      textures: memory.textures,
      programs: programs?.length ?? 0,
      triangles: render.triangles,
      calls: render.calls,
    };
  }
}
