import { DecodePool, Superseded } from '../decode/pool';
import { takeDecodeWorker, takePictureWorker, takeSocket } from '../head_start';
import { decodeTileFrame, FrameKind, type TileFrame } from '../protocol/frame';
import {
  type CameraPose,
  fusionState,
  type QualityChange,
  robotMoved,
  sceneChanged,
  status,
  type StreamComplete,
  streamComplete,
  streamStats,
} from '../protocol/messages';
import type { Insets, UpAxis, View } from '../view/first_view';
import { FrameIntake } from '../tiles/frame_intake';
import { TileSet } from '../tiles/tile_set';
import { FIELD_OF_VIEW_DEG, Viewport, type ViewportEvents } from '../view/viewport';
import { mustLogIn } from '../transport/access';
import { CatalogueLoader } from '../transport/catalogue_loader';
import { Coalescer } from '../transport/coalescer';
import { Connection, ConnectionLost } from '../transport/connection';
import { FirstLook } from '../view/first_look';
import { flightTo } from '../view/flight';
import { highlightContrast } from '../view/highlight_contrast';
import { FLATTEST, MARK_REACH_PX, Markers, type Window } from '../view/markers';
import { UpChoices } from '../view/up_choices';
import { Expectation } from './expectation';
import { HighlightedShare } from './highlighted_share';
import { Fusing, type FusingWish } from './fusing';
import { Progress } from './progress';
import { QualityWish } from './quality_wish';
import { Readings } from './readings';
import { robotAfter } from './robot';
import { ScreenWords } from './screen_words';
import { Settings } from './settings';
import type { OutlineWish, Store } from './store.svelte';
import { Subscription } from './subscription';

/** Least time between two camera messages. */
const CAMERA_INTERVAL_MS = 100;
const TICK_MS = 100;

/** One user's session: builds what it is made of and tells its parts of each other, and hands the actions of the interface on. */
export class Session {
  readonly viewport: Viewport;
  readonly tiles: TileSet;
  readonly settings: Settings;
  readonly quality: QualityWish;
  readonly readings: Readings;
  readonly fusing: Fusing;
  readonly #connection: Connection;
  readonly #catalogue: CatalogueLoader;
  readonly #subscription: Subscription;
  readonly #progress: Progress;
  /** How often somebody has said where the camera is to be. */
  #moves = 0;
  readonly #cameraSender: Coalescer<CameraPose>;
  readonly #ticker: ReturnType<typeof setInterval>;

  readonly #intake: FrameIntake;
  readonly #look: FirstLook;
  readonly #markers: Markers;
  readonly #share: HighlightedShare;
  readonly #words = new ScreenWords();
  #nextPicture: ReturnType<typeof setTimeout> | undefined;
  /** Colours of all of the scene in its first picture, which does not wait for what is said of them. */
  #firstColours: Uint8Array | null = null;

  constructor(
    canvas: HTMLCanvasElement,
    readonly store: Store,
    url: string,
    drawing: { inWorker: boolean; onFailure: (message: string, everDrew: boolean) => void },
  ) {
    const say = (error: unknown): void => this.#say(error);
    const request = (method: string, params: object): Promise<unknown> => this.#connection.request(method, params);
    const events: ViewportEvents = {
      onCamera: (pose) => this.#cameraMoved(pose),
      onResize: () => this.#look.pictureIs(null),
      onUserMove: () => this.#userMoved(),
      beforeRender: () => this.#bringIn(),
      onDrawn: () => this.#drawn(),
      onDetail: (levels) => this.tiles.leaveOut(levels),
      onContext: (isLost) => {
        store.graphicsLostAt = isLost ? performance.now() : null;
      },
      onFirstPicture: () => {
        store.pictureStands = true;
        if (this.#firstColours !== null) this.#judge(this.#firstColours);
        this.readings.askFacts();
      },
      onCanFuse: () => this.fusing.drawerIsReady(),
      onNotFused: (message) => this.fusing.drawerHasFailed(message),
      onFailure: drawing.onFailure,
    };
    this.viewport = new Viewport(canvas, events, drawing.inWorker ? takePictureWorker() : null);
    this.tiles = new TileSet((geometry, rgba) => this.viewport.createTile(geometry, rgba));
    this.#look = new FirstLook(
      this.viewport,
      new UpChoices(),
      () => this.tiles.shownGeometries(),
      (up) => {
        store.upAxis = up;
      },
    );
    this.#share = new HighlightedShare(store, this.viewport, (rgba) => this.#judge(rgba));
    this.fusing = new Fusing(store, this.tiles, this.viewport, {
      request,
      resubscribe: () => void this.#subscription.channelsChanged(),
      isBusy: () => this.settings.busy,
      answeredGeneration: () => this.settings.answeredGeneration,
      isTakenIn: () => this.#intake.isTakenIn,
      onShown: (method) => this.#progress.beginHere(method, this.viewport.nextPicture),
      onBehind: () => this.#progress.begin(),
      onHighlighted: (method, highlighted) => this.#share.changed(method, highlighted),
      onLeft: () => {
        this.#progress.leftHere();
        this.readings.askHistogram();
      },
    });
    this.readings = new Readings(store, this.viewport, {
      request,
      onExtremes: (found) => this.#markers.extremesAre(found),
      onProblem: say,
      isBusy: () => this.settings.busy,
      probeHere: async (point) => (this.fusing.isHere ? this.viewport.probe(point) : null),
    });
    this.#markers = new Markers(
      this.viewport,
      (depth) => {
        const drawn_m = Math.max((store.quality?.position_step_mm ?? 0) / 1000, store.drawnError?.position_m ?? 0);
        const pixel_m = (2 * depth * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360)) / this.viewport.size[1];
        // A point is drawn as a disc, which sticks out of the sheet that it lies in.
        const disc_m = store.scene?.point_cloud === true ? (MARK_REACH_PX * pixel_m) / FLATTEST : 0;
        return Math.max(2 * drawn_m, pixel_m, disc_m);
      },
      (camera, window) => this.readings.extremesInView(camera, window),
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
      onProblem: say,
      onRawProblem: (message) => this.fusing.failed(message),
    });
    const expectation = new Expectation(store, this.tiles);
    this.#connection = new Connection(
      url,
      {
        onHello: (message) => {
          store.robot = null;
          this.#progress.disconnected();
          this.#subscription.greeted(message);
        },
        onNotification: (method, params) => this.#notified(method, params),
        onFrame: (message) => this.#received(message),
        onState: (state) => {
          store.link = state;
          if (state.phase === 'waiting' && store.lostAt === null && store.scene !== undefined) this.#disconnected();
          // A refused upgrade looks like a broken link to a page.
          if (state.phase === 'waiting') void mustLogIn().then((must) => must && location.replace('./login'));
        },
        expectsMuch: () => expectation.isMuch(),
        onProtocolError: (error) => console.warn('left out:', error.message),
        onRoundTrip: (round_trip_ms) => {
          const before = store.round_trip_ms;
          store.round_trip_ms = before === null ? round_trip_ms : before + (round_trip_ms - before) * 0.3;
        },
      },
      takeSocket,
    );
    const onChange = (): void => this.#progress.begin();
    this.settings = new Settings(store, {
      request,
      onChange: () => this.#progress.begin(true),
      onInForce: () => this.readings.askHistogram(),
      onProblem: say,
      fuseHere: (wanted) => this.fusing.apply(wanted),
    });
    this.quality = new QualityWish(store, {
      request,
      onChange,
      onRefusal: (error) => this.settings.refused(error),
      onProblem: say,
    });
    this.#progress = new Progress(store, this.tiles, this.settings);
    this.#catalogue = new CatalogueLoader({
      onLoaded: ({ methods, palettes }) => {
        store.methods = methods;
        store.palettes = palettes;
        this.settings.reconsiderMissing();
      },
      onFailure: (failure) => {
        store.catalogueFailure = failure;
      },
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
    const concerned = {
      tiles: this.tiles,
      intake: this.#intake,
      settings: this.settings,
      quality: this.quality,
      readings: this.readings,
      progress: this.#progress,
      look: this.#look,
      catalogue: this.#catalogue,
      fusing: this.fusing,
    };
    this.#subscription = new Subscription(store, url, concerned, {
      request,
      tellCamera: () => this.#cameraSender.push(this.viewport.pose),
      invalidate: () => this.viewport.invalidate(),
      onProblem: say,
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
    this.#share.dispose();
    this.tiles.clear();
    this.viewport.dispose();
  }

  // Actions of the interface

  setQuality(change: QualityChange): void {
    this.quality.set(change);
  }

  setFusing(wish: FusingWish): void {
    this.fusing.setWish(wish);
  }

  setOutline(wish: OutlineWish): void {
    this.store.outlineWish = wish;
    this.viewport.setOutline(this.store.isOutlined);
    if (this.store.connected) this.quality.askMarks();
  }

  /** Hatches what is less sure than a positive number of kelvin. */
  setHatch(kelvin: number): void {
    const { store } = this;
    const before = store.hatchAbove_kelvin;
    store.hatchAbove_kelvin = kelvin > 0 ? kelvin : null;
    this.viewport.setHatch(store.hatchAbove_kelvin);
    if ((before === null) !== (store.hatchAbove_kelvin === null)) void this.#subscription.channelsChanged();
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
    this.followRobot(false);
    this.#moves += 1;
    if (mode === 'fit') this.#look.fit();
    else this.#look.reset();
  }

  /** Looks from a place the caller has chosen, and stays there. */
  setView(view: View): void {
    this.#userMoved();
    this.viewport.setView(view, false);
  }

  /** Goes to where the hottest or the coldest place of the scene is seen, on a side with nothing in between. */
  async flyTo(kind: 'hottest' | 'coldest'): Promise<void> {
    const { scene, extremes: places, quality } = this.store;
    const target = places?.[kind]?.position;
    if (!scene || target === undefined) return;
    const step_m = (quality?.position_step_mm ?? 1) / 1000;
    const wish = flightTo(target, this.viewport.pose.eye, scene.core_bounds ?? scene.bounds, step_m);
    const move = ++this.#moves;
    const found = await this.viewport.sightOf(wish);
    // The user has gone somewhere else meanwhile.
    if (move !== this.#moves) return;
    if (found === null) {
      this.#say(new Error(`The ${kind} place lies between surfaces that touch each other: it cannot be seen from anywhere.`));
      return;
    }
    this.#userMoved();
    this.viewport.setView({ eye: found, target }, true);
  }

  /** Goes along with the robot, until it is told not to or somebody moves the camera. */
  followRobot(isOn: boolean): void {
    if (isOn && this.store.robot === null) return;
    if (isOn) this.#look.userMoved();
    this.store.followsRobot = isOn;
  }

  retryNow(): void {
    this.#connection.retryNow();
    this.#catalogue.retryNow();
  }

  /** See Readings. */
  hover(place: { x: number; y: number } | null): void {
    this.readings.hover(place);
  }

  pin(place: { x: number; y: number }): Promise<void> {
    return this.readings.pin(place);
  }

  markBaseline(): Promise<void> {
    return this.readings.markBaseline();
  }

  unpin(): void {
    this.readings.unpin();
  }

  #userMoved(): void {
    this.#moves += 1;
    this.store.followsRobot = false;
    this.#look.userMoved();
  }

  // The connection

  #disconnected(): void {
    this.store.lostAt = this.#connection.lastMessageAt || performance.now();
    this.store.hover = null;
    this.#progress.disconnected();
  }

  #notified(method: string, params: unknown): void {
    const { store } = this;
    switch (method) {
      case 'scene.changed':
        this.#subscription.sceneChanged(sceneChanged(params, method).scene);
        break;
      case 'fusion.changed': {
        const { generation, fusion } = fusionState(params, method);
        // Nobody has asked for it: the scene has changed by itself.
        const isVersion = store.wanted === null && !this.settings.busy && fusion.method === store.fusionInForce?.method;
        if (isVersion) this.tiles.isVersion(generation);
        this.fusing.factsChanged();
        // What is fused here is what is set here.
        if (this.fusing.isHere) store.generation = Math.max(store.generation, generation);
        else this.settings.inForce(generation, fusion);
        break;
      }
      case 'stream.complete':
        this.#subscription.linkIsFree();
        this.#intake.completeAfterAll(streamComplete(params, method));
        break;
      case 'stream.stats':
        store.stats = streamStats(params, method);
        this.#intake.shownAfterAll(store.stats);
        break;
      case 'robot.moved':
        store.robot = robotAfter(store.robot, robotMoved(params, method));
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

  // Frames

  #received(message: ArrayBuffer): void {
    this.#progress.received(message.byteLength);
    let frame: TileFrame;
    try {
      frame = decodeTileFrame(message);
    } catch (error) {
      this.#say(error);
      return;
    }
    this.#intake.receive(frame);
    // The link is free while the first picture is decoded and drawn.
    if (frame.kind !== FrameKind.geometry) this.#subscription.linkIsFree();
  }

  /** Brings decoded tiles into the picture. Returns true when the next one has work, too. */
  #bringIn(): boolean {
    const { bytes, next_ms, complete, shown } = this.#intake.bringIn(performance.now());
    if (shown !== null) this.#progress.shows(shown, this.viewport.nextPicture);
    if (complete !== null) this.#completed(complete);
    const isOther = this.tiles.updateSelection();
    if (isOther || complete !== null) this.readings.differs(this.viewport.nextPicture);
    if (isOther || bytes > 0) {
      this.store.shown = this.tiles.counts();
      this.store.costs = this.tiles.costs();
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
    this.tiles.settle();
    this.store.shown = this.tiles.counts();
    this.#markers.update();
    this.readings.pictureIsOf(message.scene_revision, this.viewport.nextPicture);
    // What is not made here any more is not waited for.
    this.fusing.completed(message.generation);
    this.#progress.completed(message, this.viewport.nextPicture);
  }

  /** What is said of the screen follows what is on it. */
  #drawn(): void {
    this.#progress.drawn(this.viewport.pictures);
    this.readings.drawn(this.viewport.pictures);
    this.#sayError();
  }

  #cameraMoved(pose: CameraPose): void {
    const { store } = this;
    store.camera = pose;
    store.axes = this.viewport.axesInView();
    this.#markers.update();
    this.#sayError();
    this.readings.cameraMoved();
    this.#cameraSender.push(pose);
  }

  #tick(): void {
    this.store.now = performance.now();
    this.store.heardAt = this.store.connected ? this.#connection.lastMessageAt : null;
    this.#drawn();
    this.#progress.tick();
    this.fusing.consider();
  }

  /** What the status says of the picture. */
  #sayError(): void {
    const { store, viewport } = this;
    const isVisible = viewport.visibility();
    const generations = [...this.tiles.drawnGenerations(isVisible)];
    this.#words.pictureIs(viewport.nextPicture, { error: this.tiles.drawnError(isVisible), methods: this.#methods(generations) });
    const { error, methods } = this.#words.afterPicture(viewport.pictures);
    if (String(Object.values(error ?? {})) !== String(Object.values(store.drawnError ?? {}))) {
      store.drawnError = error;
      // How far the picture may be off tells what lies before a marked place.
      this.#markers.update();
    }
    if (String(methods) !== String(store.shownMethods)) store.shownMethods = methods;
    const newest = Math.max(...generations.filter((generation) => generation !== null));
    store.isOfOldSettings = newest >= 0 && newest < this.settings.answeredGeneration;
  }

  /** Which methods the picture shows; a tile of which that is not known shows what all of it showed when it was last complete. */
  #methods(generations: readonly (number | null)[]): string[] {
    const { pictureMethod } = this.store;
    const methods = generations.map(
      (generation) => (generation === null ? null : this.settings.methodOf(generation)) ?? pictureMethod,
    );
    if (this.fusing.isHere) methods.push(pictureMethod);
    return methods.filter((method) => method !== null);
  }

  #say(error: unknown): void {
    if (error instanceof ConnectionLost || error instanceof Superseded) return;
    const message = error instanceof Error ? error.message : String(error);
    console.warn(message);
    this.store.failure = message;
  }
}
