import {
  BufferAttribute,
  BufferGeometry,
  ColorManagement,
  DoubleSide,
  LinearSRGBColorSpace,
  Mesh,
  MeshBasicMaterial,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderer,
} from 'three';
import { nearestHit } from './picking';
import type { CameraMatrices, GpuObjects, RenderCommand, RenderReply, RenderRequest, TileArrays } from './render_messages';

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
  readonly #surface = new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, toneMapped: false, fog: false });
  readonly #cloud = new PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false, toneMapped: false, fog: false });
  readonly #tiles = new Map<number, Tile>();
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
    canvas.addEventListener('webglcontextrestored', () => this.#drawSoon());
  }

  handle(request: Exclude<RenderRequest, { kind: 'start' }>): void {
    switch (request.kind) {
      case 'picture':
        this.#lookFrom(request.camera);
        for (const command of request.commands) this.#apply(command);
        this.#newest = request.number;
        this.#drawSoon();
        break;
      case 'pick': {
        const visible = [...this.#tiles.values()].filter(({ object }) => object.visible).map(({ arrays }) => arrays);
        this.reply({ kind: 'picked', id: request.id, distance: nearestHit(visible, request.ray, request.cone) });
        break;
      }
      case 'copy':
        void this.#copy(request.id);
    }
  }

  dispose(): void {
    if (this.#frame !== 0) cancelAnimationFrame(this.#frame);
    for (const tile of [...this.#tiles.keys()]) this.#apply({ change: 'dispose', tile });
    this.#surface.dispose();
    this.#cloud.dispose();
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
        this.#renderer.setClearColor(command.colour, 1);
        break;
      case 'size':
        this.#renderer.setPixelRatio(command.pixel_ratio);
        this.#renderer.setSize(command.width, command.height, false);
        // Resizing empties the canvas: draw in the same task, so that no blank picture is shown.
        this.#draw();
    }
  }

  #create(arrays: TileArrays): Tile {
    const { positions, indices, rgba, centre, radius } = arrays;
    const geometry = new BufferGeometry();
    const colours = new BufferAttribute(rgba, 4, true);
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', colours);
    if (indices !== null) geometry.setIndex(new BufferAttribute(indices, 1));
    geometry.boundingSphere = new Sphere(new Vector3(...centre), radius);
    const object = indices === null ? new Points(geometry, this.#cloud) : new Mesh(geometry, this.#surface);
    object.matrixAutoUpdate = false;
    object.visible = false;
    this.#scene.add(object);
    return { object, colours, arrays: { positions, indices, centre, radius } };
  }

  /** Draws an empty tile of each kind, so that the shaders are compiled before the first real one comes. */
  #drawSpecimens(): void {
    const specimen = {
      rgba: new Uint8Array(12),
      positions: new Float32Array(9),
      centre: [0, 0, 0],
      radius: 1,
    } satisfies Partial<TileArrays>;
    const specimens = [
      this.#create({ ...specimen, indices: Uint16Array.from([0, 0, 0]) }),
      this.#create({ ...specimen, indices: null }),
    ];
    for (const { object } of specimens) {
      object.visible = true;
      object.frustumCulled = false;
    }
    this.#draw();
    for (const { object } of specimens) {
      this.#scene.remove(object);
      object.geometry.dispose();
    }
  }

  #lookFrom({ world_from_camera, clip_from_camera }: CameraMatrices): void {
    this.#camera.matrix.fromArray(world_from_camera);
    this.#camera.matrixWorldNeedsUpdate = true;
    this.#camera.projectionMatrix.fromArray(clip_from_camera);
    this.#camera.projectionMatrixInverse.copy(this.#camera.projectionMatrix).invert();
  }

  #drawSoon(): void {
    if (this.#frame !== 0) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      this.#draw();
      this.#whenDone(this.#newest);
    });
  }

  /** Tells the page that a picture has been drawn once the GPU is through with it, so that a slow one is not given more and more. */
  #whenDone(number: number): void {
    const gl = this.#renderer.getContext() as WebGL2RenderingContext;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const check = () => {
      const isDone = fence === null || gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
      if (!isDone) {
        setTimeout(check, FENCE_INTERVAL_MS);
        return;
      }
      gl.deleteSync(fence);
      this.reply({ kind: 'drawn', number, gpu: this.#gpuObjects });
    };
    check();
  }

  #draw(): void {
    this.#renderer.render(this.#scene, this.#camera);
  }

  async #copy(id: number): Promise<void> {
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
