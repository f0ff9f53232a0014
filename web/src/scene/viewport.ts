import CameraControls from 'camera-controls';
import {
  Box3,
  ColorManagement,
  LinearSRGBColorSpace,
  MathUtils,
  Matrix4,
  PerspectiveCamera,
  Quaternion,
  Raycaster,
  Scene as ThreeScene,
  Sphere,
  Spherical,
  Vector2,
  Vector3,
  Vector4,
  WebGLRenderer,
} from 'three';
import type { DecodedGeometry } from '../decode/messages';
import type { CameraPose, Vec3 } from '../protocol/messages';
import { type Insets, UP, type UpAxis, type View } from './first_view';
import { nearestHit } from './picking';
import { TileDrawing } from './tile_drawing';

// Colours are sRGB bytes made by the server; nothing may convert them on their way to the screen.
ColorManagement.enabled = false;
CameraControls.install({
  THREE: { Box3, MathUtils, Matrix4, Quaternion, Raycaster, Sphere, Spherical, Vector2, Vector3, Vector4 },
});

export const FIELD_OF_VIEW_DEG = 45;

export interface ViewportEvents {
  /** The camera has moved, or the picture has changed its size. */
  onCamera: (pose: CameraPose) => void;
  /** The picture has changed its size. */
  onResize: () => void;
  /** The user moved the camera: from now on it is not moved for them. */
  onUserMove: () => void;
  /** Called before each picture, to bring in what has been decoded. Returns true when more waits for the next picture. */
  beforeRender: () => boolean;
}

/** The 3D picture: camera, controls and renderer. Renders only when something has changed. */
export class Viewport {
  readonly tiles = new TileDrawing(() => this.invalidate());
  readonly #renderer: WebGLRenderer;
  readonly #scene = new ThreeScene();
  readonly #camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.1, 1000);
  readonly #controls: CameraControls;
  readonly #resize: ResizeObserver;
  readonly #reducedMotion = matchMedia('(prefers-reduced-motion: reduce)');
  #frame = 0;
  #lastFrameAt = 0;
  #size: [number, number] = [1, 1];
  #up: UpAxis = 'y';
  #sceneCentre = new Vector3();
  #sceneRadius = 1;
  #pictures = 0;
  #ready = false;

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly events: ViewportEvents,
  ) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    this.#renderer.debug.checkShaderErrors = import.meta.env.DEV;
    this.#renderer.outputColorSpace = LinearSRGBColorSpace;
    this.#scene.add(this.tiles.group);
    this.#scene.matrixAutoUpdate = false;
    this.#controls = new CameraControls(this.#camera, canvas);
    this.#controls.dollyToCursor = true;
    this.#controls.smoothTime = this.#reducedMotion.matches ? 0 : 0.06;
    this.#controls.draggingSmoothTime = this.#reducedMotion.matches ? 0 : 0.03;
    this.#controls.mouseButtons.middle = CameraControls.ACTION.TRUCK;
    this.#controls.touches.two = CameraControls.ACTION.TOUCH_DOLLY_TRUCK;
    this.#controls.touches.three = CameraControls.ACTION.TOUCH_TRUCK;
    this.#controls.addEventListener('control', () => this.events.onUserMove());
    for (const wake of ['control', 'controlstart', 'wake', 'transitionstart'] as const) {
      this.#controls.addEventListener(wake, () => this.invalidate());
    }
    this.#fitToElement();
    const removeSpecimens = this.tiles.addSpecimens();
    const compiled = () => {
      // The first use of a program asks the GPU about it and waits for the answer: here, where nothing keeps it busy yet.
      this.#renderer.render(this.#scene, this.#camera);
      removeSpecimens();
      this.#ready = true;
      this.invalidate();
    };
    if (this.#renderer.extensions.has('KHR_parallel_shader_compile')) {
      this.#renderer.compileAsync(this.#scene, this.#camera).then(compiled, compiled);
    } else {
      this.#renderer.compile(this.#scene, this.#camera);
      setTimeout(compiled);
    }
    this.#resize = new ResizeObserver(() => {
      this.#fitToElement();
      this.events.onResize();
      this.events.onCamera(this.pose);
    });
    this.#resize.observe(canvas);
    canvas.addEventListener('webglcontextrestored', () => this.invalidate());
  }

  /** Pictures drawn so far. */
  get pictures(): number {
    return this.#pictures;
  }

  /** Objects the renderer holds on the GPU. */
  get gpuObjects(): { geometries: number; textures: number; programs: number; triangles: number; calls: number } {
    const { memory, programs, render } = this.#renderer.info;
    return {
      geometries: memory.geometries,
      textures: memory.textures,
      programs: programs?.length ?? 0,
      triangles: render.triangles,
      calls: render.calls,
    };
  }

  get aspect(): number {
    return this.#size[0] / this.#size[1];
  }

  get size(): [number, number] {
    return this.#size;
  }

  get pose(): CameraPose {
    const target = this.#controls.getTarget(new Vector3(), false);
    return {
      eye: this.#camera.position.toArray(),
      target: target.toArray(),
      up: UP[this.#up],
      fov_y_deg: this.#camera.fov,
      viewport: [...this.#size],
    };
  }

  /** The axes of the scene as the camera sees them: right, up, towards the viewer. */
  axesInView(): { x: Vec3; y: Vec3; z: Vec3 } {
    const inverse = this.#camera.quaternion.clone().invert();
    const axis = (x: number, y: number, z: number): Vec3 => new Vector3(x, y, z).applyQuaternion(inverse).toArray();
    return { x: axis(1, 0, 0), y: axis(0, 1, 0), z: axis(0, 0, 1) };
  }

  setBackground(colour: string): void {
    this.#renderer.setClearColor(Number.parseInt(colour.slice(1), 16), 1);
    this.invalidate();
  }

  setUpAxis(up: UpAxis): void {
    if (this.#up === up) return;
    const { eye, target } = this.pose;
    this.#up = up;
    this.#camera.up.set(...UP[up]);
    this.#controls.updateCameraUp();
    void this.#controls.setLookAt(...eye, ...target, false);
    this.invalidate();
  }

  /** What near and far plane and the controls' limits are made from. */
  setSceneExtent(centre: Vec3, radius: number): void {
    this.#sceneCentre.set(...centre);
    this.#sceneRadius = Math.max(radius, 1e-6);
    this.#controls.minDistance = this.#sceneRadius * 0.002;
    this.#controls.maxDistance = this.#sceneRadius * 20;
    this.invalidate();
  }

  setView(view: View, animated: boolean): void {
    void this.#controls.setLookAt(...view.eye, ...view.target, animated && !this.#reducedMotion.matches);
    this.invalidate();
  }

  /** Turns the camera about its target so that it looks along an axis of the scene. */
  lookAlong(direction: Vec3): void {
    const { target } = this.pose;
    const distance = this.#controls.distance;
    this.events.onUserMove();
    this.setView(
      {
        eye: [target[0] + direction[0] * distance, target[1] + direction[1] * distance, target[2] + direction[2] * distance],
        target,
      },
      true,
    );
  }

  /** Keyboard control: radians for turning, shares of the distance for moving and nearing. */
  turn(azimuth_rad: number, polar_rad: number): void {
    this.events.onUserMove();
    void this.#controls.rotate(azimuth_rad, polar_rad, !this.#reducedMotion.matches);
    this.invalidate();
  }
  move(right: number, down: number): void {
    this.events.onUserMove();
    const distance = this.#controls.distance;
    void this.#controls.truck(right * distance, down * distance, !this.#reducedMotion.matches);
    this.invalidate();
  }
  approach(share: number): void {
    this.events.onUserMove();
    void this.#controls.dolly(share * this.#controls.distance, !this.#reducedMotion.matches);
    this.invalidate();
  }

  /** Point of the scene under a place on the canvas (CSS pixels from its corner), or null. */
  pick(x: number, y: number, geometries: Iterable<DecodedGeometry>): Vec3 | null {
    const [width, height] = this.#size;
    const place = new Vector3((x / width) * 2 - 1, 1 - (y / height) * 2, 0.5).unproject(this.#camera);
    const eye = this.#camera.position;
    const direction = place.sub(eye).normalize();
    const cone = (4 * Math.tan((this.#camera.fov * Math.PI) / 360) * 2) / height;
    const distance = nearestHit(geometries, { origin: eye.toArray(), direction: direction.toArray() }, cone);
    return distance === null ? null : direction.multiplyScalar(distance).add(eye).toArray();
  }

  /** Where a point of the scene is on the canvas, in CSS pixels; null behind the camera. */
  project(point: Vec3): { x: number; y: number; depth: number } | null {
    this.#camera.updateMatrixWorld();
    const inView = new Vector3(...point).applyMatrix4(this.#camera.matrixWorldInverse);
    if (inView.z >= 0) return null;
    const clip = inView.clone().applyMatrix4(this.#camera.projectionMatrix);
    return { x: ((clip.x + 1) / 2) * this.#size[0], y: ((1 - clip.y) / 2) * this.#size[1], depth: -inView.z };
  }

  /** Draws now and hands the canvas over while it still holds the picture. */
  withPicture<T>(use: (canvas: HTMLCanvasElement) => T): T {
    this.#draw();
    return use(this.canvas);
  }

  invalidate(): void {
    if (this.#frame === 0) this.#frame = requestAnimationFrame((now) => this.#tick(now));
  }

  dispose(): void {
    cancelAnimationFrame(this.#frame);
    this.#resize.disconnect();
    this.#controls.dispose();
    this.tiles.dispose();
    this.#renderer.dispose();
  }

  #tick(now: number): void {
    this.#frame = 0;
    const elapsed_s = Math.min(0.1, (now - this.#lastFrameAt) / 1000);
    this.#lastFrameAt = now;
    const more = this.#ready && this.events.beforeRender();
    const moved = this.#controls.update(elapsed_s);
    this.#draw();
    if (moved) this.events.onCamera(this.pose);
    if (moved || more) this.invalidate();
  }

  #draw(): void {
    const distance = this.#camera.position.distanceTo(this.#sceneCentre);
    const near = Math.max(distance - this.#sceneRadius * 1.05, this.#sceneRadius * 5e-4, distance * 1e-4);
    const far = distance + this.#sceneRadius * 1.05;
    if (near !== this.#camera.near || far !== this.#camera.far) {
      this.#camera.near = near;
      this.#camera.far = far;
      this.#camera.updateProjectionMatrix();
    }
    if (!this.#ready) {
      this.#renderer.clear();
      return;
    }
    this.#renderer.render(this.#scene, this.#camera);
    this.#pictures += 1;
  }

  #fitToElement(): void {
    const width = Math.max(1, this.canvas.clientWidth);
    const height = Math.max(1, this.canvas.clientHeight);
    this.#size = [width, height];
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    // Resizing empties the canvas: draw in the same task, so that no blank picture is shown.
    this.#draw();
  }
}

export type { Insets };
