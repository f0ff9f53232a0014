import { DecodePool, Superseded } from '../decode/pool';
import { takeDecodeWorker, takeSocket } from '../head_start';
import { decodeTileFrame, FrameKind, type TileFrame } from '../protocol/frame';
import {
  type CameraPose,
  type Extremes,
  extremes,
  type FusionChange,
  fusionState,
  type Hello,
  histogram,
  probe,
  type Quality,
  type QualityChange,
  qualityState,
  type Scene,
  sceneChanged,
  status,
  type StreamComplete,
  streamComplete,
  streamStats,
  subscribed,
} from '../protocol/messages';
import type { Insets, UpAxis, View } from '../scene/first_view';
import { FrameIntake } from '../scene/frame_intake';
import { TileSet } from '../scene/tile_set';
import { FIELD_OF_VIEW_DEG, Viewport, type ViewportEvents } from '../scene/viewport';
import { CatalogueLoader } from '../transport/catalogue_loader';
import { Coalescer } from '../transport/coalescer';
import { Connection, ConnectionLost, RpcError } from '../transport/connection';
import { FirstLook } from '../view/first_look';
import { highlightContrast } from '../view/highlight_contrast';
import { Markers, type Window } from '../view/markers';
import { UpChoices } from '../view/up_choices';
import { cacheBytes } from './cache_bytes';
import { Settings } from './settings';
import type { OutlineWish, Store } from './store.svelte';

const HISTOGRAM_BINS = 192;
/** Least time between two changes of the quality, and between two camera messages. */
const QUALITY_INTERVAL_MS = 33;
const CAMERA_INTERVAL_MS = 100;
const HOVER_INTERVAL_MS = 120;
const TICK_MS = 100;
/** Distance to what is flown to, as a share of the scene's diagonal. */
const SIGHT_SHARE = 0.08;
/** Most tiles that scene.subscribe may claim; what is held beyond them comes again. */
const MOST_CLAIMED = 1500;

/** One user's session: the connection, what it brings, and the actions of the interface. */
export class Session {
  readonly viewport: Viewport;
  readonly tiles: TileSet;
  readonly settings: Settings;
  readonly #connection: Connection;
  readonly #catalogue: CatalogueLoader;
  readonly #qualitySender: Coalescer<QualityChange>;
  readonly #cameraSender: Coalescer<CameraPose>;
  readonly #histogramAsker: Coalescer<true>;
  readonly #hoverAsker: Coalescer<{ x: number; y: number }>;
  readonly #ticker: ReturnType<typeof setInterval>;

  readonly #intake: FrameIntake;
  readonly #look: FirstLook;
  readonly #markers: Markers;
  #nextPicture: ReturnType<typeof setTimeout> | undefined;
  /** Colours of all of the scene in its first picture, which does not wait for what is said of them. */
  #firstColours: Uint8Array | null = null;
  #connectionNumber = 0;
  /** Where methods and palettes are; null when it is known, or being asked for. */
  #catalogueAddress: string | null = null;
  /** Session whose server knows what the tile set claims. */
  #claimableSession: string | null = null;
  #isHovering = false;
  #qualityChanged = false;
  /** What this connection was last asked for. */
  #asksMarks = false;
  #bytesBefore = 0;
  #rateWindow: { at: number; bytes: number }[] = [];

  constructor(
    canvas: HTMLCanvasElement,
    readonly store: Store,
    private readonly url: string,
    drawing: { inWorker: boolean; onFailure: (message: string, everDrew: boolean) => void },
  ) {
    const events: ViewportEvents = {
      onCamera: (pose) => this.#cameraMoved(pose),
      onResize: () => this.#look.pictureIs(null),
      onUserMove: () => this.#look.userMoved(),
      beforeRender: () => this.#bringIn(),
      onDetail: (levels) => this.tiles.leaveOut(levels),
      onContext: (isLost) => {
        store.graphicsLostAt = isLost ? performance.now() : null;
      },
      onFirstPicture: () => {
        store.pictureStands = true;
        if (this.#firstColours !== null) this.#judge(this.#firstColours);
        this.#askFacts();
      },
      onFailure: drawing.onFailure,
    };
    this.viewport = new Viewport(canvas, events, drawing.inWorker);
    this.tiles = new TileSet((geometry, rgba) => this.viewport.createTile(geometry, rgba));
    this.#look = new FirstLook(
      this.viewport,
      new UpChoices(),
      () => this.tiles.shownGeometries(),
      (up) => {
        store.upAxis = up;
      },
    );
    this.#markers = new Markers(
      this.viewport,
      (depth) => {
        const drawn_m = Math.max((store.quality?.position_step_mm ?? 0) / 1000, store.drawnError?.position_m ?? 0);
        const pixel_m = (2 * depth * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360)) / this.viewport.size[1];
        return Math.max(2 * drawn_m, pixel_m);
      },
      (camera, window) => this.#extremesInView(camera, window),
      (marks) => {
        store.marks = marks;
      },
    );
    this.#intake = new FrameIntake(this.tiles, new DecodePool(takeDecodeWorker), {
      onDecoded: (sequence) => this.#connection.notify('stream.ack', { sequence }),
      onArrival: () => this.viewport.invalidate(),
      onWholeColours: (rgba) => {
        if (store.pictureStands) this.#judge(rgba);
        // The colours themselves move on to what draws.
        else this.#firstColours = rgba.slice();
      },
      onProblem: (error) => this.#say(error),
    });
    this.#connection = new Connection(
      url,
      {
        onHello: (message) => this.#greeted(message),
        onNotification: (method, params) => this.#notified(method, params),
        onFrame: (message) => this.#received(message),
        onState: (state) => {
          store.link = state;
          if (state.phase === 'waiting' && store.lostAt === null && store.scene !== undefined) this.#disconnected();
        },
        onProtocolError: (error) => console.warn('left out:', error.message),
        onRoundTrip: (round_trip_ms) => {
          const before = store.round_trip_ms;
          store.round_trip_ms = before === null ? round_trip_ms : before + (round_trip_ms - before) * 0.3;
        },
      },
      takeSocket,
    );
    this.settings = new Settings(store, {
      request: (method, params) => this.#connection.request(method, params),
      onChange: () => this.#markBehind(),
      onInForce: () => this.#histogramAsker.push(true),
      onProblem: (error) => this.#say(error),
    });
    this.#catalogue = new CatalogueLoader({
      onLoaded: ({ methods, palettes }) => {
        store.methods = methods;
        store.palettes = palettes;
        this.settings.catalogueCame();
      },
      onFailure: (failure) => {
        store.catalogueFailure = failure;
      },
    });
    this.#qualitySender = new Coalescer({
      send: (change) => this.#sendQuality(change),
      merge: (earlier, later) => ({ ...earlier, ...later }),
      interval_ms: QUALITY_INTERVAL_MS,
      max_in_flight: 1,
    });
    this.#cameraSender = new Coalescer({
      send: (pose) => {
        this.#connection.notify('camera.set', pose);
        return Promise.resolve();
      },
      merge: (_earlier, later) => later,
      interval_ms: CAMERA_INTERVAL_MS,
      max_in_flight: 1,
    });
    this.#histogramAsker = new Coalescer({
      send: () => this.#askHistogram(),
      merge: () => true,
      interval_ms: 100,
      max_in_flight: 1,
    });
    this.#hoverAsker = new Coalescer({
      send: (place) => this.#askHover(place),
      merge: (_earlier, later) => later,
      interval_ms: HOVER_INTERVAL_MS,
      max_in_flight: 1,
    });
    this.viewport.setBackground(store.background);
    this.#ticker = setInterval(() => this.#tick(), TICK_MS);
    this.#connection.start();
  }

  dispose(): void {
    clearInterval(this.#ticker);
    clearTimeout(this.#nextPicture);
    this.#connection.stop();
    this.#catalogue.dispose();
    this.#intake.dispose();
    this.#markers.dispose();
    this.tiles.clear();
    this.viewport.dispose();
  }

  // Actions of the interface

  setQuality(change: QualityChange): void {
    this.#qualityChanged = true;
    if (this.store.quality !== null) this.store.quality = { ...this.store.quality, ...change };
    this.#qualitySender.push(change);
  }

  /** Unless it is off the colours say which vertices are highlighted, so that automatic can compare them with the rest. */
  setOutline(wish: OutlineWish): void {
    this.store.outlineWish = wish;
    this.viewport.setOutline(this.store.isOutlined);
    if (this.store.connected) this.#askMarks();
  }

  setBackground(colour: string): void {
    this.store.background = colour;
    this.viewport.setBackground(colour);
  }

  /** Diameter of a cloud's points in metres; anything but a positive number: as far as they are apart. */
  setPointDiameter(diameter_m: number): void {
    this.store.pointDiameter_m = diameter_m > 0 ? diameter_m : null;
    this.viewport.setPointDiameter(this.store.pointDiameter_m);
  }

  setUpAxis(up: UpAxis): void {
    this.#look.chooseUp(up);
  }

  setInsets(insets: Insets): void {
    this.#look.pictureIs(insets);
  }

  /** The part of the picture that no control covers. */
  setWindow(window: Window): void {
    this.#markers.windowIs(window);
  }

  /** `fit` keeps the direction of the camera, `reset` goes back to the first view. */
  fitView(mode: 'fit' | 'reset'): void {
    if (mode === 'fit') this.#look.fit();
    else this.#look.reset();
  }

  /** Looks from a place the caller has chosen, and stays there. */
  setView(view: View): void {
    this.#look.userMoved();
    this.viewport.setView(view, false);
  }

  /** Goes to where the hottest or the coldest place of the scene is seen, on a side with nothing in between. */
  async flyTo(kind: 'hottest' | 'coldest'): Promise<void> {
    const { scene, extremes: places } = this.store;
    const target = places?.[kind]?.position;
    if (!scene || target === undefined) return;
    const { eye } = this.viewport.pose;
    const { min, max } = scene.core_bounds ?? scene.bounds;
    const size = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) || 1;
    const [x, y, z] = [eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]];
    const away = Math.hypot(x, y, z) || 1;
    const step_m = (this.store.quality?.position_step_mm ?? 1) / 1000;
    const found = await this.viewport.sightOf({
      target,
      distance: size * SIGHT_SHARE,
      tolerance: Math.min(size * 1e-3, 3 * step_m),
      preferred: [x / away, y / away, z / away],
    });
    if (found === null) {
      this.#say(new Error(`The ${kind} place lies between surfaces that touch each other: it cannot be seen from anywhere.`));
      return;
    }
    this.#look.userMoved();
    this.viewport.setView({ eye: found, target }, true);
  }

  async #extremesInView(camera: CameraPose, window: Window): Promise<Extremes | null> {
    const { store } = this;
    if (!store.connected || !store.marksShown || store.server?.capabilities.includes('extremes_in_view') !== true) return null;
    try {
      return extremes(await this.#connection.request('scene.extremes', { camera, window }), 'scene.extremes');
    } catch (error) {
      // A server that is busy with other things: nothing is marked.
      if (!(error instanceof RpcError)) this.#say(error);
      return null;
    }
  }

  retryNow(): void {
    this.#connection.retryNow();
    this.#catalogue.retryNow();
  }

  /** The pointer is over this place of the canvas; null when it has left. */
  hover(place: { x: number; y: number } | null): void {
    this.#isHovering = place !== null;
    if (place === null) {
      this.#hoverAsker.reset();
      this.store.hover = null;
      return;
    }
    if (this.store.connected) this.#hoverAsker.push(place);
  }

  /** Reads the scene at a place of the canvas and keeps the reading on the screen. */
  async pin(place: { x: number; y: number }): Promise<void> {
    try {
      const point = await this.viewport.pick(place.x, place.y);
      if (point === null) {
        this.store.pinned = null;
        return;
      }
      const answer = probe(await this.#connection.request('scene.probe', { position: point }), 'scene.probe');
      this.store.pinned = { reading: { ...place, probe: answer }, place: this.viewport.project(answer.position) };
    } catch (error) {
      this.#say(error);
    }
  }

  unpin(): void {
    this.store.pinned = null;
  }

  // The connection

  #greeted(message: Hello): void {
    const { store } = this;
    const returning = store.scene !== undefined;
    const qualityBefore = returning && this.#qualityChanged ? store.quality : null;
    this.#connectionNumber += 1;
    this.#qualitySender.reset();
    this.#histogramAsker.reset();

    store.server = message;
    if ('catalogue' in message) {
      this.#catalogueAddress = new URL(message.catalogue, this.url.replace(/^ws/, 'http')).href;
      // The first picture goes before it.
      if (returning) this.#linkIsFree();
    } else {
      this.#catalogueAddress = null;
      this.#catalogue.wantNone();
      store.methods = message.methods;
      store.palettes = message.palettes;
    }
    if (message.scene === null) this.#linkIsFree();
    const before = this.settings.greeted(message.fusion, returning);
    store.quality = qualityBefore ?? message.quality;
    store.lostAt = null;
    store.statuses = [];
    store.complete = null;
    this.#intake.beginConnection();
    this.#setScene(message.scene, true);
    this.#cameraSender.push(this.viewport.pose);
    this.#markBehind();
    this.#asksMarks = store.quality.marks;
    void this.#subscribe(message, before, qualityBefore);
    // Before the stream, which is asked for at the end of this task at the earliest.
    this.#askMarks();
  }

  /** What the first picture takes has come, or there will be none: now it is the turn of the rest. */
  #linkIsFree(): void {
    this.store.isLinkFree = true;
    const address = this.#catalogueAddress;
    this.#catalogueAddress = null;
    if (address !== null) this.#catalogue.want(address);
  }

  #askMarks(): void {
    const marks = this.store.outlineWish !== 'off';
    if (this.store.server?.capabilities.includes('marks') !== true || marks === this.#asksMarks) return;
    this.#asksMarks = marks;
    void this.#sendQuality({ marks });
  }

  /** Asks for the stream once the user's settings are in force again: nothing in other colours, or of another accuracy, is sent first. */
  async #subscribe(greeting: Hello, fusion: FusionChange | null, quality: Quality | null): Promise<void> {
    const connectionNumber = this.#connectionNumber;
    await Promise.all([fusion && this.settings.send(fusion), quality && this.#sendQuality(quality)]);
    if (connectionNumber !== this.#connectionNumber) return;
    if (!this.settings.busy) this.store.wanted = null;
    const session_id = this.#claimableSession;
    const claims = session_id !== null && greeting.capabilities.includes('resume') ? this.tiles.claims(MOST_CLAIMED) : [];
    try {
      const answer = await this.#connection.request('scene.subscribe', {
        channels: ['fused'],
        ...(greeting.capabilities.includes('cache_bytes')
          ? { cache_bytes: cacheBytes((navigator as Navigator & { deviceMemory?: number }).deviceMemory) }
          : {}),
        ...(greeting.capabilities.includes('subtract_green') ? { colour_transform: 'subtract_green' } : {}),
        ...(claims.length > 0 ? { resume: { session_id, tiles: claims } } : {}),
      });
      if (connectionNumber !== this.#connectionNumber) return;
      const { resumed_tiles = 0 } = subscribed(answer, 'scene.subscribe');
      this.tiles.resume(claims, resumed_tiles > 0);
      this.#claimableSession = greeting.session_id;
      this.viewport.invalidate();
    } catch (error) {
      this.#say(error);
    }
  }

  #disconnected(): void {
    this.store.lostAt = this.#connection.lastMessageAt || performance.now();
    this.store.hover = null;
    this.store.behindSince = null;
    this.store.rate_bytes_per_s = 0;
    this.store.wanted = this.store.wanted ?? null;
  }

  #notified(method: string, params: unknown): void {
    const { store } = this;
    switch (method) {
      case 'scene.changed':
        this.#setScene(sceneChanged(params, method).scene, false);
        this.#markBehind();
        break;
      case 'fusion.changed': {
        const { generation, fusion } = fusionState(params, method);
        // Nobody has asked for it: the scene has changed by itself.
        if (store.wanted === null && !this.settings.busy) this.tiles.isVersion(generation);
        this.settings.inForce(generation, fusion);
        break;
      }
      case 'stream.complete':
        this.#linkIsFree();
        this.#intake.completeAfterAll(streamComplete(params, method));
        break;
      case 'stream.stats':
        store.stats = streamStats(params, method);
        break;
      case 'status': {
        const message = status(params, method);
        const others = store.statuses.filter((other) => other.id !== message.id);
        store.statuses = message.message === null ? others : [...others, message];
        break;
      }
      default:
    }
  }

  #setScene(next: Scene | null, fresh: boolean): void {
    const { store } = this;
    const before = store.scene;
    store.scene = next;
    if (next === null) {
      this.tiles.clear();
      this.#look.sceneIs(null);
      store.histogram = null;
      store.extremes = null;
      this.#markers.extremesAre(null);
      this.viewport.invalidate();
      return;
    }
    const same = before?.name === next.name;
    // A running connection says itself what goes; what a new one does not know of must go when it is of another scene.
    if (fresh && before && !(same && JSON.stringify(before.bounds) === JSON.stringify(next.bounds))) this.tiles.clear();
    this.#look.sceneIs(next);
    if (!this.#qualityChanged && store.quality !== null)
      store.quality = { ...store.quality, position_step_mm: next.position_step_m * 1000 };
    if (!same) {
      store.pinned = null;
      store.pictureMethod = null;
    }
    this.#askFacts();
  }

  /** What is said of the scene beside the picture; the first picture goes before it. */
  #askFacts(): void {
    const { store } = this;
    if (!store.scene || !store.pictureStands) return;
    this.#histogramAsker.push(true);
    this.#connection
      .request('scene.extremes', {})
      .then((answer) => {
        store.extremes = extremes(answer, 'scene.extremes');
        this.#markers.extremesAre(store.extremes);
      })
      .catch((error: unknown) => this.#say(error));
  }

  // Settings

  async #sendQuality(change: QualityChange): Promise<void> {
    try {
      const wire: Partial<Quality> = { mode: this.store.quality?.mode ?? 'manual', ...change };
      this.#markBehind();
      this.store.quality = qualityState(await this.#connection.request('quality.set', wire), 'quality.set').quality;
    } catch (error) {
      if (error instanceof RpcError) this.settings.refused(error);
      else this.#say(error);
    }
  }

  async #askHistogram(): Promise<void> {
    if (!this.store.scene || !this.store.pictureStands) return;
    try {
      this.store.histogram = histogram(
        await this.#connection.request('scene.histogram', { bins: HISTOGRAM_BINS }),
        'scene.histogram',
      );
    } catch (error) {
      this.#say(error);
    }
  }

  // Frames

  #received(message: ArrayBuffer): void {
    this.store.received_bytes += message.byteLength;
    this.#rateWindow.push({ at: performance.now(), bytes: message.byteLength });
    let frame: TileFrame;
    try {
      frame = decodeTileFrame(message);
    } catch (error) {
      this.#say(error);
      return;
    }
    this.#intake.receive(frame);
    // The link is free while the first picture is decoded and drawn.
    if (frame.kind !== FrameKind.geometry) this.#linkIsFree();
  }

  /** Brings decoded tiles into the picture. Returns true when the next one has work, too. */
  #bringIn(): boolean {
    const { bytes, next_ms, complete } = this.#intake.bringIn(performance.now());
    if (complete !== null) this.#completed(complete);
    if (this.tiles.updateSelection() || bytes > 0) {
      this.store.shown = this.tiles.counts();
      this.#look.pictureChanged();
      this.#sayError();
    }
    clearTimeout(this.#nextPicture);
    if (next_ms !== null && next_ms > 0) this.#nextPicture = setTimeout(() => this.viewport.invalidate(), next_ms);
    return next_ms === 0;
  }

  /** Whether what is highlighted stands out from the rest. */
  #judge(rgba: Uint8Array): void {
    this.#firstColours = null;
    this.store.highlightContrast = highlightContrast(rgba);
    this.viewport.setOutline(this.store.isOutlined);
  }

  #completed(message: StreamComplete): void {
    const { store } = this;
    this.tiles.settle();
    store.shown = this.tiles.counts();
    this.#markers.update();
    store.complete = message;
    if (message.generation >= store.generation && !this.settings.busy) {
      if (store.behindSince !== null) {
        store.lastUpdate = { bytes: store.received_bytes - this.#bytesBefore, ms: performance.now() - store.behindSince };
      }
      store.behindSince = null;
      store.progress = 1;
      store.pictureMethod = store.fusionInForce?.method ?? null;
    }
  }

  // The camera

  #cameraMoved(pose: CameraPose): void {
    const { store } = this;
    store.camera = pose;
    store.axes = this.viewport.axesInView();
    this.#markers.update();
    this.#sayError();
    if (store.pinned !== null) {
      store.pinned = { ...store.pinned, place: this.viewport.project(store.pinned.reading.probe.position) };
    }
    this.#cameraSender.push(pose);
  }

  async #askHover(place: { x: number; y: number }): Promise<void> {
    try {
      const point = await this.viewport.pick(place.x, place.y);
      if (point !== null) this.viewport.aimAt(point);
      const answer = point && probe(await this.#connection.request('scene.probe', { position: point }), 'scene.probe');
      this.store.hover = answer === null || !this.#isHovering ? null : { ...place, probe: answer };
    } catch {
      this.store.hover = null;
    }
  }

  // Clock

  #markBehind(): void {
    if (this.store.behindSince !== null) return;
    this.store.behindSince = performance.now();
    this.#bytesBefore = this.store.received_bytes;
  }

  #tick(): void {
    const { store } = this;
    const now = performance.now();
    store.now = now;
    this.#rateWindow = this.#rateWindow.filter(({ at }) => now - at < 2000);
    store.rate_bytes_per_s = this.#rateWindow.reduce((sum, { bytes }) => sum + bytes, 0) / 2;
    if (store.behindSince !== null) store.progress = this.#progress();
    this.#sayError();
  }

  /** What the status says of the picture, as soon as the picture is another one. */
  #sayError(): void {
    const error = this.tiles.drawnError(this.viewport.visibility());
    const before = this.store.drawnError;
    const isSame =
      error?.position_m === before?.position_m &&
      error?.colour_levels === before?.colour_levels &&
      error?.rounding_levels === before?.rounding_levels &&
      error?.temperature_celsius === before?.temperature_celsius;
    if (!isSame) this.store.drawnError = error;
  }

  #progress(): number {
    const { store } = this;
    // Before the first picture is complete nobody can say which tiles it takes; at most it is all of them.
    if (store.complete === null) return this.tiles.size / Math.max(1, this.tiles.size, store.scene?.tile_count ?? 0);
    const { current, total } = this.tiles.progress(store.generation);
    return total === 0 ? 0 : current / total;
  }

  #say(error: unknown): void {
    if (error instanceof ConnectionLost || error instanceof Superseded) return;
    const message = error instanceof Error ? error.message : String(error);
    console.warn(message);
    this.store.failure = message;
  }
}
