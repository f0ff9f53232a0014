import type { DecodedGeometry } from '../decode/messages';
import type { SceneFacts } from '../fusion/fusion_module';
import type { CameraPose, FusionChange, Vec3 } from '../protocol/messages';
import { directionInScene, distanceOf, type Look, lookAt, toView, worldFromCamera } from '../view/look';
import type { Steering } from '../view/steering';
import { UP, type UpAxis, type View } from './first_view';
import type { SightWish } from '../draw/clear_sight';
import type { GpuObjects, ProbedVertex, RenderCommand, RenderReply, RenderRequest } from '../draw/render_messages';
import type { Highlighting } from '../draw/surface_share';
import { type RenderPort, startRenderingHere, startRenderWorker } from '../draw/render_port';
import { MotionPace, type Notch } from './motion_pace';
import type { Drawable } from '../tiles/tile_set';

export const FIELD_OF_VIEW_DEG = 45;
/** Pictures that may be on their way to the drawing side: one that it draws and one that waits. */
const MOST_UNDRAWN = 2;
/** A camera that has not moved for so long rests. */
const REST_MS = 200;

export interface ViewportEvents {
  /** The camera has moved, or the picture has changed its size. */
  onCamera: (pose: CameraPose) => void;
  /** The picture has changed its size. */
  onResize: () => void;
  /** The user moved the camera: from now on it is not moved for them. */
  onUserMove: () => void;
  /** Called before each picture, to bring in what has been decoded. Returns true when more waits for the next picture. */
  beforeRender: () => boolean;
  /** More pictures have been drawn. */
  onDrawn: () => void;
  /** So many of the finest levels are to be left out, while the camera moves on a slow machine; 0: none. */
  onDetail: (levels: number) => void;
  /** The browser has taken the GPU away, or given it back and the picture is drawn again. */
  onContext: (isLost: boolean) => void;
  /** The first picture with any of the scene in it stands on the screen. */
  onFirstPicture: () => void;
  /** The library with which tiles are fused here is ready. */
  onCanFuse: () => void;
  /** Tiles cannot be fused here. */
  onNotFused: (message: string) => void;
  /** The drawing side has failed; `everDrew` false: it could not even start. */
  onFailure: (message: string, everDrew: boolean) => void;
}

/** How the first picture is drawn, and those before it with nothing in them: seen at once, and sharp as soon as it stands. */
const FIRST: Notch = { resolution: 0.5, levels: 0 };
/** Where the camera stands before anything says where. */
const NOWHERE = lookAt([0, 0, 1], [0, 0, 0], UP.y);

/** The 3D picture: camera, steering, and the way to what draws it. Draws only when something has changed. */
export class Viewport {
  readonly #port: RenderPort;
  #look: Look = NOWHERE;
  /** Null before startSteering(): until then the camera stands where it is put. */
  #steering: Steering | null = null;
  /** What is to be done as soon as it is. */
  #toSteer: ((steering: Steering) => void)[] = [];
  #reach: [number, number] | null = null;
  /** The camera has been put elsewhere, and no picture has been sent from there yet. */
  #hasMoved = false;
  readonly #resize: ResizeObserver;
  readonly #reducedMotion = matchMedia('(prefers-reduced-motion: reduce)');
  #frame = 0;
  #lastFrameAt = 0;
  #size: [number, number] = [1, 1];
  #up: UpAxis = 'y';
  #isAiming = false;
  /** Asked for while the answer to the one before was out. */
  #toAimAt: [number, number] | null = null;
  #isOutlined = false;
  readonly #pace = new MotionPace();
  /** How pictures that have been sent and not drawn are drawn; null: in full. */
  #notches = new Map<number, Notch | null>();
  #isMoving = false;
  /** The next picture is from another place, which the camera did not travel to: it is drawn in full. */
  #isJump = false;
  #picture_ms = 0;
  #rest: ReturnType<typeof setTimeout> | undefined;

  /** Changes that the next picture takes along, and the buffers that move with them. */
  #commands: RenderCommand[] = [];
  #transfer: Transferable[] = [];
  #tileNumber = 0;
  #sent = 0;
  #drawn = 0;
  #isHeldUp = false;
  /** Between the beginning of a picture and its sending. */
  #isPutTogether = false;
  /** Number of the first picture that has any of the scene in it; null: it has not been sent, or it stands already. */
  #firstPicture: number | null = null;
  #hasShown = false;
  #isFirstDrawn = false;
  #gpu: GpuObjects = { geometries: 0, textures: 0, programs: 0, triangles: 0, calls: 0 };
  #questionId = 0;
  #questions = new Map<number, (reply: RenderReply) => void>();

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly events: ViewportEvents,
    /** Draws; null: the page does it itself. */
    worker: Worker | null,
  ) {
    const onReply = (reply: RenderReply): void => this.#replied(reply);
    this.#port = worker === null ? startRenderingHere(canvas, onReply) : startRenderWorker(worker, canvas, onReply);
    // Before the controls come nearer to it.
    canvas.addEventListener('wheel', this.#aimAtPointer, { capture: true, passive: true });
    canvas.addEventListener('pointerdown', this.#aimAtPointer, { capture: true, passive: true });
    this.#fitToElement();
    this.#resize = new ResizeObserver(() => {
      this.#fitToElement();
      this.events.onResize();
      this.events.onCamera(this.pose);
    });
    this.#resize.observe(canvas);
  }

  /** Pictures drawn so far; of several that were asked for within one frame of the screen all count. */
  get pictures(): number {
    return this.#drawn;
  }

  /** Number of the first picture that has all that has changed so far, as `pictures` counts them. */
  get nextPicture(): number {
    return this.#commands.length > 0 ? this.#sent + 1 : this.#sent;
  }

  /** True when the last picture that was asked for has been drawn, and none is due. */
  get isUpToDate(): boolean {
    return this.#drawn > 0 && this.#frame === 0 && !this.#isMoving && !this.#isHeldUp && this.#drawn === this.#sent;
  }

  get movesInFull(): boolean {
    const { resolution, levels } = this.#pace.moving;
    return resolution === 1 && levels === 0;
  }

  /** How pictures are drawn while the camera moves; null at rest. */
  get notch(): Notch | null {
    return this.#isMoving ? this.#pace.moving : null;
  }

  /** What the last picture at rest took to be drawn. */
  get picture_ms(): number {
    return this.#picture_ms;
  }

  /** Objects held on the GPU when the last picture was drawn. */
  get gpuObjects(): GpuObjects {
    return this.#gpu;
  }

  /** Makes one tile, hidden until it is shown. The arrays are moved away with the next picture. */
  createTile(geometry: DecodedGeometry, rgba: Uint8Array<ArrayBuffer>): Drawable {
    this.#tileNumber += 1;
    const tile = this.#tileNumber;
    const { centre, radius, point_spacing, area_sum } = geometry.summary;
    const { positions } = geometry;
    // Triangles without any area would not be seen: their vertices are.
    const indices = area_sum > 0 ? geometry.indices : null;
    this.#change({ change: 'create', tile, arrays: { positions, indices, rgba, centre, radius, point_spacing } }, [
      positions.buffer,
      rgba.buffer,
      ...(indices === null ? [] : [indices.buffer]),
    ]);
    return {
      setRaw: (raw) =>
        this.#change(
          { change: 'raw', tile, raw },
          [raw.codes, raw.rgb].flatMap((layer) => (layer === undefined ? [] : [layer.buffer])),
        ),
      setSigma: (sigma) => this.#change({ change: 'sigma', tile, sigma }, [sigma.codes.buffer]),
      setColours: (next) => this.#change({ change: 'colours', tile, rgba: next }, [next.buffer]),
      setVisible: (visible) => {
        if (visible && !this.#hasShown) {
          this.#hasShown = true;
          this.#firstPicture = this.#sent + 1;
        }
        this.#change({ change: 'visible', tile, visible });
      },
      dispose: () => this.#change({ change: 'dispose', tile }),
    };
  }

  /** What tiles with raw arrays are fused with here. */
  startFusing(module: WebAssembly.Module): void {
    this.#change({ change: 'module', module });
  }
  setFacts(facts: SceneFacts): void {
    this.#change({ change: 'facts', facts });
  }
  /** Null: tiles keep the colours that they are given. */
  fuse(settings: FusionChange | null): void {
    this.#change({ change: 'fuse', settings });
  }

  /** The vertex of what is drawn that is nearest to a point, by the raw arrays that are here. */
  async probe(point: Vec3): Promise<ProbedVertex | null> {
    const reply = await this.#ask((id) => ({ kind: 'probe', id, point }));
    return reply.kind === 'probed' ? reply.vertex : null;
  }

  /** What of what is drawn is highlighted; null where not all of it is fused here. */
  async highlighting(): Promise<Highlighting | null> {
    const reply = await this.#ask((id) => ({ kind: 'highlighting', id }));
    return reply.kind === 'highlighting' ? reply.found : null;
  }

  get aspect(): number {
    return this.#size[0] / this.#size[1];
  }

  get size(): [number, number] {
    return this.#size;
  }

  get pose(): CameraPose {
    const { eye, target } = this.#look;
    return {
      eye,
      target,
      up: UP[this.#up],
      fov_y_deg: FIELD_OF_VIEW_DEG,
      viewport: [...this.#size],
    };
  }

  /** The axes of the scene as the camera sees them: right, up, towards the viewer. */
  axesInView(): { x: Vec3; y: Vec3; z: Vec3 } {
    const { right, up, back } = this.#look;
    const axis = (i: 0 | 1 | 2): Vec3 => [right[i], up[i], back[i]];
    return { x: axis(0), y: axis(1), z: axis(2) };
  }

  /** Tells of a sphere (metres) whether any of it may be on the screen. */
  visibility(): (centre: Vec3, radius: number) => boolean {
    const look = this.#look;
    const [right, top] = this.#tangents;
    return (centre, radius) => {
      const [x, y, z] = toView(look, centre);
      // A plane through the eye and a side of the picture: how far beyond it the sphere's centre is.
      const beyond = (across: number, tangent: number) => (Math.abs(across) + z * tangent) / Math.hypot(1, tangent);
      return -z > -radius && beyond(x, right) < radius && beyond(y, top) < radius;
    };
  }

  setBackground(colour: string): void {
    this.#change({ change: 'background', colour: Number.parseInt(colour.slice(1), 16) });
  }

  setUpAxis(up: UpAxis): void {
    if (this.#up === up) return;
    this.#up = up;
    this.#stand(this.#look.eye, this.#look.target);
    this.#steering?.setUp(UP[up], this.#look);
    this.invalidate();
  }

  /** Diameter of the points of a cloud in metres; null: as far as they are apart. */
  setPointDiameter(diameter: number | null): void {
    this.#change({ change: 'points', diameter });
  }

  /** A line around what is highlighted, where the colours say what that is. */
  setOutline(isOn: boolean): void {
    if (isOn === this.#isOutlined) return;
    this.#isOutlined = isOn;
    this.#change({ change: 'outline', isOn });
  }

  /** Hatches what is less sure than that, or of which nobody knows; null: nothing. */
  setHatch(kelvin: number | null): void {
    this.#change({ change: 'hatch', kelvin });
  }

  /** How near to and how far from what is looked at the controls go, metres. */
  setReach(nearest: number, farthest: number): void {
    this.#reach = [nearest, farthest];
    this.#steering?.setReach(nearest, farthest);
  }

  /** From now on a person moves the camera: what has been asked for before is done now. */
  startSteering(SteeringOfPage: typeof Steering): void {
    if (this.#steering !== null) return;
    const from = {
      look: this.#look,
      up: UP[this.#up],
      fov_deg: FIELD_OF_VIEW_DEG,
      reach: this.#reach,
      isStill: this.#reducedMotion.matches,
    };
    this.#steering = new SteeringOfPage(this.canvas, from, {
      onSteer: () => this.events.onUserMove(),
      onWake: () => this.invalidate(),
    });
    this.#steering.setAspect(this.aspect);
    for (const act of this.#toSteer.splice(0)) act(this.#steering);
  }

  setView(view: View, animated: boolean): void {
    const isTravel = animated && !this.#reducedMotion.matches && this.#steering !== null;
    this.#isJump = !isTravel;
    if (this.#steering === null) {
      this.#stand(view.eye, view.target);
      this.#hasMoved = true;
    } else this.#steering.setView(view.eye, view.target, isTravel);
    this.invalidate();
  }

  /** Takes the camera along with something that moves: a picture of the way, not of an end. */
  carryTo({ eye, target }: View): void {
    if (this.#steering === null) {
      this.#stand(eye, target);
      this.#hasMoved = true;
    } else this.#steering.setView(eye, target, false);
    this.invalidate();
  }

  /** Turns the camera about its target so that it looks along an axis of the scene. */
  lookAlong(direction: Vec3): void {
    const { target } = this.pose;
    const distance = this.#steering?.distance ?? distanceOf(this.#look);
    this.events.onUserMove();
    this.setView(
      {
        eye: [target[0] + direction[0] * distance, target[1] + direction[1] * distance, target[2] + direction[2] * distance],
        target,
      },
      true,
    );
  }

  /** Puts what the camera turns about and comes nearer to at the depth of this point. The picture stays as it is. */
  aimAt(point: Vec3): void {
    this.#steering?.aimAt(point);
  }

  /** Keyboard control: radians for turning, shares of the distance for moving and nearing. */
  turn(azimuth_rad: number, polar_rad: number): void {
    this.#steer((steering, isAnimated) => steering.turn(azimuth_rad, polar_rad, isAnimated));
  }
  move(right: number, down: number): void {
    this.#steer((steering, isAnimated) => steering.move(right, down, isAnimated));
  }
  approach(share: number): void {
    this.#steer((steering, isAnimated) => {
      void this.#aim(this.#size[0] / 2, this.#size[1] / 2);
      steering.approach(share, isAnimated);
    });
  }

  /** Point of the scene under a place on the canvas (CSS pixels from its corner), or null; points of a cloud have a radius of `reach_px`. */
  async pick(x: number, y: number, reach_px = 4): Promise<Vec3 | null> {
    const [width, height] = this.#size;
    const [right, top] = this.#tangents;
    const { eye } = this.#look;
    const across: Vec3 = [((x / width) * 2 - 1) * right, (1 - (y / height) * 2) * top, -1];
    const length = Math.hypot(...across);
    const direction = directionInScene(this.#look, across.map((value) => value / length) as Vec3);
    const cone = (reach_px * top * 2) / height;
    const reply = await this.#ask((id) => ({ kind: 'pick', id, ray: { origin: eye, direction }, cone }));
    if (reply.kind !== 'picked' || reply.distance === null) return null;
    const { distance } = reply;
    return eye.map((value, axis) => value + direction[axis]! * distance) as Vec3;
  }

  /** Where a place on a surface is seen from, by what is drawn; null where it is walled in. */
  async sightOf(wish: SightWish): Promise<Vec3 | null> {
    const reply = await this.#ask((id) => ({ kind: 'sight', id, wish }));
    return reply.kind === 'sighted' ? reply.eye : null;
  }

  /** Where a point of the scene is on the canvas, in CSS pixels; null behind the camera. */
  project(point: Vec3): { x: number; y: number; depth: number } | null {
    const [x, y, z] = toView(this.#look, point);
    if (z >= 0) return null;
    const [right, top] = this.#tangents;
    return { x: ((1 - x / z / right) / 2) * this.#size[0], y: ((1 + y / z / top) / 2) * this.#size[1], depth: -z };
  }

  /** The picture as it is now; the caller closes it. */
  async copy(): Promise<ImageBitmap> {
    this.#rests();
    this.events.beforeRender();
    this.#send();
    const reply = await this.#ask((id) => ({ kind: 'copy', id }));
    if (reply.kind !== 'copied' || reply.picture === null) throw new Error('There is no picture while the graphics restart.');
    return reply.picture;
  }

  invalidate(): void {
    if (this.#frame === 0 && !this.#isPutTogether) this.#frame = requestAnimationFrame((now) => this.#tick(now));
  }

  dispose(): void {
    cancelAnimationFrame(this.#frame);
    clearTimeout(this.#rest);
    this.#resize.disconnect();
    this.canvas.removeEventListener('wheel', this.#aimAtPointer, { capture: true });
    this.canvas.removeEventListener('pointerdown', this.#aimAtPointer, { capture: true });
    this.#steering?.dispose();
    this.#port.dispose();
    this.#questions.clear();
  }

  #change(command: RenderCommand, transfer: Transferable[] = []): void {
    this.#commands.push(command);
    this.#transfer.push(...transfer);
    this.invalidate();
  }

  #tick(now: number): void {
    this.#frame = 0;
    const elapsed_s = Math.min(0.1, (now - this.#lastFrameAt) / 1000);
    // A picture at rest is given up for the first one of a movement: only those while moving hold each other up.
    const undrawn = [...this.#notches.values()].filter((notch) => !this.#isMoving || notch !== null).length;
    // The first one is not given up for what comes next: on a slow machine there would be none for as long as tiles come.
    const isFirst = this.#firstPicture !== null && this.#sent >= this.#firstPicture && !this.#isMoving;
    if ((isFirst || undrawn >= MOST_UNDRAWN) && (this.#isMoving || this.#steering?.isActive !== true)) {
      this.#isHeldUp = true;
      return;
    }
    this.#lastFrameAt = now;
    const moved = this.#follow(elapsed_s);
    if (moved && !this.#isJump) this.#moves();
    this.#isJump = false;
    // What changes meanwhile is in this picture: it calls for no other one.
    this.#isPutTogether = true;
    const more = this.events.beforeRender();
    this.#isPutTogether = false;
    // It may have decided where to look from, too: nothing is seen from anywhere else first.
    const jumped = this.#isJump && this.#follow(0);
    this.#isJump = false;
    this.#send();
    if (moved || jumped) this.events.onCamera(this.pose);
    if (moved || more) this.invalidate();
  }

  #stand(eye: Vec3, target: Vec3): void {
    this.#look = lookAt(eye, target, UP[this.#up]);
  }

  /** Takes over where the camera is by now. Returns whether that is another place than before. */
  #follow(elapsed_s: number): boolean {
    const look = this.#steering?.update(elapsed_s) ?? null;
    if (look !== null) this.#look = look;
    const moved = look !== null || this.#hasMoved;
    this.#hasMoved = false;
    return moved;
  }

  /** A person moves the camera by keys: at once, or as soon as that can be done. */
  #steer(act: (steering: Steering, isAnimated: boolean) => void): void {
    this.events.onUserMove();
    const acting = (steering: Steering) => {
      act(steering, !this.#reducedMotion.matches);
      this.invalidate();
    };
    if (this.#steering === null) this.#toSteer.push(acting);
    else acting(this.#steering);
  }

  #send(): void {
    this.#sent += 1;
    const eye = {
      world_from_camera: worldFromCamera(this.#look),
      tangents: this.#tangents,
      distance: distanceOf(this.#look),
    };
    const notch = this.#isMoving ? this.#pace.moving : this.#isFirstDrawn ? null : FIRST;
    this.#notches.set(this.#sent, notch);
    const resolution = notch?.resolution ?? 1;
    const isMoving = notch !== null;
    this.#port.send({ kind: 'picture', number: this.#sent, commands: this.#commands, eye, resolution, isMoving }, this.#transfer);
    this.#commands = [];
    this.#transfer = [];
  }

  /** Until the camera has rested for a moment, pictures are drawn as the machine can. */
  #moves(): void {
    this.#isMoving = true;
    this.events.onDetail(this.#pace.moving.levels);
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => this.#rests(), REST_MS);
  }

  #rests(): void {
    clearTimeout(this.#rest);
    if (!this.#isMoving) return;
    this.#isMoving = false;
    this.events.onDetail(0);
    this.invalidate();
  }

  /** Half the picture's width and height at distance 1. */
  get #tangents(): [number, number] {
    const top = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    return [top * this.aspect, top];
  }

  readonly #aimAtPointer = (event: MouseEvent): void => {
    const { left, top } = this.canvas.getBoundingClientRect();
    void this.#aim(event.clientX - left, event.clientY - top);
  };

  /** Aims at what is seen at a place of the canvas; where nothing is, nothing changes. */
  async #aim(x: number, y: number): Promise<void> {
    this.#toAimAt = [x, y];
    if (this.#isAiming) return;
    this.#isAiming = true;
    while (this.#toAimAt !== null) {
      const place = this.#toAimAt;
      this.#toAimAt = null;
      const point = await this.pick(...place);
      if (point !== null) this.aimAt(point);
    }
    this.#isAiming = false;
  }

  #ask(question: (id: number) => Extract<RenderRequest, { id: number }>) {
    this.#questionId += 1;
    const id = this.#questionId;
    return new Promise<RenderReply>((resolve) => {
      this.#questions.set(id, resolve);
      this.#port.send(question(id), []);
    });
  }

  #drawnIn({ number, ms }: Extract<RenderReply, { kind: 'drawn' }>): void {
    const notch = this.#notches.get(number) ?? null;
    if (notch !== FIRST) this.#pace.drawn(ms, notch);
    if (notch === null) this.#picture_ms = ms;
  }

  #replied(reply: RenderReply): void {
    switch (reply.kind) {
      case 'drawn':
        // Of two pictures the GPU may be found to be through with the later one first.
        this.#drawn = Math.max(this.#drawn, reply.number);
        this.#gpu = reply.gpu;
        this.#drawnIn(reply);
        for (const number of this.#notches.keys()) if (number <= reply.number) this.#notches.delete(number);
        if (this.#firstPicture !== null && reply.number >= this.#firstPicture) {
          this.#firstPicture = null;
          this.#isFirstDrawn = true;
          this.events.onFirstPicture();
          // Now as sharp as the screen is.
          this.invalidate();
        }
        this.events.onDrawn();
        if (!this.#isHeldUp) break;
        this.#isHeldUp = false;
        this.invalidate();
        break;
      case 'context':
        this.events.onContext(reply.isLost);
        break;
      case 'can_fuse':
        this.events.onCanFuse();
        break;
      case 'not_fused':
        this.events.onNotFused(reply.message);
        break;
      case 'failed':
        this.events.onFailure(reply.message, this.#drawn > 0);
        break;
      default:
        this.#questions.get(reply.id)?.(reply);
        this.#questions.delete(reply.id);
    }
  }

  #fitToElement(): void {
    const width = Math.max(1, this.canvas.clientWidth);
    const height = Math.max(1, this.canvas.clientHeight);
    this.#size = [width, height];
    this.#steering?.setAspect(width / height);
    this.#change({ change: 'size', width, height, pixel_ratio: Math.min(devicePixelRatio, 2) });
  }
}
