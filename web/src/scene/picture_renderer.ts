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
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import type { Vec3 } from '../protocol/messages';
import { clearSight } from './clear_sight';
import { depthRange } from './depth_range';
import { nearestHit } from './picking';
import type { Eye, GpuObjects, RenderCommand, RenderReply, RenderRequest, TileArrays } from './render_messages';
import { TileMaterials } from './tile_materials';

// Colours are sRGB bytes made by the server; nothing may convert them on their way to the screen.
ColorManagement.enabled = false;

const FENCE_INTERVAL_MS = 3;

interface Tile {
  object: Mesh | Points;
  colours: BufferAttribute;
  arrays: Omit<TileArrays, 'rgba'>;
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
  #fullPixelRatio = 1;
  #resolution = 1;
  #pixelRatio = 1;
  #pointDiameter: number | null = null;
  #isResized = false;
  #frame = 0;
  #newest = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement | OffscreenCanvas,
    private readonly reply: (message: RenderReply, transfer?: Transferable[]) => void,
  ) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    this.#renderer.debug.checkShaderErrors = import.meta.env.DEV;
    this.#renderer.outputColorSpace = LinearSRGBColorSpace;
    this.#scene.matrixAutoUpdate = false;
    this.#camera.matrixAutoUpdate = false;
    this.#drawSpecimens();
    canvas.addEventListener('webglcontextlost', () => this.reply({ kind: 'context', isLost: true }));
    // The renderer makes its objects anew from the arrays as they are drawn; what it keeps as state is to be set again.
    canvas.addEventListener('webglcontextrestored', () => {
      this.#renderer.setClearColor(this.#background, 1);
      // Only with a picture on it is the canvas shown again.
      this.#draw();
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
        this.#newest = request.number;
        this.#resolve(request.resolution);
        this.#drawSoon();
        break;
      case 'pick':
        this.reply({ kind: 'picked', id: request.id, distance: nearestHit(this.#drawn(), request.ray, request.cone) });
        break;
      case 'sight':
        this.reply({ kind: 'sighted', id: request.id, eye: clearSight(this.#drawn(), request.wish) });
        break;
      case 'copy':
        void this.#copy(request.id);
    }
  }

  dispose(): void {
    if (this.#frame !== 0) cancelAnimationFrame(this.#frame);
    for (const tile of [...this.#tiles.keys()]) this.#apply({ change: 'dispose', tile });
    this.#materials.dispose();
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
        tile.colours.array = command.rgba;
        tile.colours.needsUpdate = true;
        break;
      }
      case 'visible': {
        const tile = this.#tiles.get(command.tile);
        if (tile !== undefined) tile.object.visible = command.visible;
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
        this.#renderer.setClearColor(command.colour, 1);
        break;
      case 'points':
        this.#pointDiameter = command.diameter;
        break;
      case 'size':
        this.#fullPixelRatio = command.pixel_ratio;
        this.#pixelRatio = command.pixel_ratio * this.#resolution;
        this.#renderer.setPixelRatio(this.#pixelRatio);
        this.#renderer.setSize(command.width, command.height, false);
        // Resizing empties the canvas: draw in the same task, so that no blank picture is shown.
        this.#draw();
    }
  }

  #drawn(): Tile['arrays'][] {
    return [...this.#tiles.values()].filter(({ object }) => object.visible).map(({ arrays }) => arrays);
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
    return { object, colours, arrays: { positions, indices, centre, radius, point_spacing } };
  }

  /** Draws an empty tile of each kind in each way, so that the shaders are compiled before the first real one comes. */
  #drawSpecimens(): void {
    const specimen = {
      rgba: new Uint8Array(12),
      positions: new Float32Array(9),
      centre: [0, 0, 0],
      radius: 1,
      point_spacing: 1,
    } satisfies Partial<TileArrays>;
    for (const indices of [Uint16Array.from([0, 0, 0]), null]) {
      const { object } = this.#create({ ...specimen, indices });
      object.visible = true;
      object.frustumCulled = false;
      for (const material of this.#materials.all) {
        if ((material.defines['POINTS'] !== undefined) !== (indices === null)) continue;
        object.material = material;
        this.#renderer.render(this.#scene, this.#camera);
      }
      this.#scene.remove(object);
      object.geometry.dispose();
    }
  }

  #drawSoon(): void {
    if (this.#frame !== 0) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      const start = performance.now();
      this.#draw();
      this.#whenDone(this.#newest, start);
    });
  }

  /** Tells the page that a picture has been drawn once the GPU is through with it, so that a slow one is not given more and more. */
  #whenDone(number: number, start: number): void {
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
      this.reply({ kind: 'drawn', number, gpu: this.#gpuObjects, ms: performance.now() - start });
    };
    check();
  }

  /** Another size of the canvas empties it; the picture that asked for it is drawn in the frame to come. */
  #resolve(resolution: number): void {
    if (resolution === this.#resolution) return;
    this.#resolution = resolution;
    this.#isResized = true;
  }

  #draw(): void {
    if (this.#isResized) {
      this.#isResized = false;
      this.#pixelRatio = this.#fullPixelRatio * this.#resolution;
      this.#renderer.setPixelRatio(this.#pixelRatio);
    }
    this.#lookFrom(this.#eye);
    this.#renderer.render(this.#scene, this.#camera);
  }

  /** The planes of near and far follow what is drawn, and with them the way in which depth is kept. */
  #lookFrom({ world_from_camera, tangents, distance }: Eye): void {
    const shown = [...this.#tiles.values()].filter(({ object }) => object.visible);
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
    this.#materials.lookFrom(eye, range, this.#renderer.getDrawingBufferSize(new Vector2()).height / (2 * top));
    const { surface, cloud } = this.#materials;
    for (const { object, arrays } of shown) object.material = arrays.indices === null ? cloud : surface;
  }

  async #copy(id: number): Promise<void> {
    if (this.context.isContextLost()) {
      this.reply({ kind: 'copied', id, picture: null });
      return;
    }
    // The canvas holds the picture only until the task that drew it ends.
    this.#draw();
    const picture = await createImageBitmap(this.canvas);
    this.reply({ kind: 'copied', id, picture }, [picture]);
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
