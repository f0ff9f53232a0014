import type { Vec3 } from '../protocol/messages';
import { AimedControls } from './aimed_controls';
import { PerspectiveCamera, Vector3 } from './three_math';
import { type Look, lookOf } from './look';

/** What a person does to the camera: with mouse, fingers and keys. A part of its own, because nothing before the first picture needs it. */
export class Steering {
  readonly #camera: PerspectiveCamera;
  readonly #controls: AimedControls;

  /** `onSteer`: a person has taken the camera; `onWake`: there will be something for update(). */
  constructor(
    canvas: HTMLCanvasElement,
    from: { look: Look; up: Vec3; fov_deg: number; reach: [number, number] | null; isStill: boolean },
    events: { onSteer: () => void; onWake: () => void },
  ) {
    this.#camera = new PerspectiveCamera(from.fov_deg);
    this.#controls = new AimedControls(this.#camera, canvas);
    this.#controls.dollyToCursor = true;
    this.#controls.smoothTime = from.isStill ? 0 : 0.06;
    this.#controls.draggingSmoothTime = from.isStill ? 0 : 0.03;
    this.#controls.mouseButtons.middle = AimedControls.ACTION.TRUCK;
    this.#controls.touches.two = AimedControls.ACTION.TOUCH_DOLLY_TRUCK;
    this.#controls.touches.three = AimedControls.ACTION.TOUCH_TRUCK;
    this.setUp(from.up, from.look);
    if (from.reach !== null) this.setReach(...from.reach);
    // It stands there already: nothing of that is a movement.
    this.#controls.update(0);
    this.#controls.addEventListener('control', events.onSteer);
    for (const wake of ['control', 'controlstart', 'wake', 'transitionstart'] as const) {
      this.#controls.addEventListener(wake, events.onWake);
    }
  }

  /** On its way, or about to be. */
  get isActive(): boolean {
    return this.#controls.active;
  }

  /** Distance to what is looked at. */
  get distance(): number {
    return this.#controls.distance;
  }

  /** Goes on for that long; null: nothing moves. */
  update(elapsed_s: number): Look | null {
    if (!this.#controls.update(elapsed_s)) return null;
    this.#camera.updateMatrixWorld();
    return lookOf(this.#camera.matrixWorld.toArray(), this.#controls.getTarget(new Vector3(), false).toArray());
  }

  /** The camera's own shape, which what comes nearer to the pointer is reckoned with. */
  setAspect(aspect: number): void {
    this.#camera.aspect = aspect;
    this.#camera.updateProjectionMatrix();
  }

  setUp(up: Vec3, { eye, target }: Look): void {
    this.#camera.up.set(...up);
    this.#controls.updateCameraUp();
    void this.#controls.setLookAt(...eye, ...target, false);
  }

  setView(eye: Vec3, target: Vec3, isAnimated: boolean): void {
    void this.#controls.setLookAt(...eye, ...target, isAnimated);
  }

  setReach(nearest: number, farthest: number): void {
    this.#controls.minDistance = nearest;
    this.#controls.maxDistance = farthest;
  }

  aimAt(point: Vec3): void {
    this.#controls.aimAt(point);
  }

  turn(azimuth_rad: number, polar_rad: number, isAnimated: boolean): void {
    void this.#controls.rotate(azimuth_rad, polar_rad, isAnimated);
  }

  move(right: number, down: number, isAnimated: boolean): void {
    const { distance } = this;
    void this.#controls.truck(right * distance, down * distance, isAnimated);
  }

  approach(share: number, isAnimated: boolean): void {
    void this.#controls.dolly(share * this.distance, isAnimated);
  }

  dispose(): void {
    this.#controls.dispose();
  }
}
