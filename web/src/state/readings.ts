import {
  baseline,
  type CameraPose,
  type Extremes,
  extremes,
  histogram,
  type Probe,
  probe,
  type Vec3,
} from '../protocol/messages';
import { Coalescer } from '../transport/coalescer';
import { BUSY, RpcError } from '../transport/connection';
import type { ProbedVertex } from '../draw/render_messages';
import type { Window } from '../view/markers';
import { highlightKey } from './fusion_change';
import type { Store } from './store.svelte';

const HISTOGRAM_BINS = 192;
const HISTOGRAM_INTERVAL_MS = 100;
const HOVER_INTERVAL_MS = 120;
/** Least time between two readings of the same place, which are of another scene. */
const AGAIN_INTERVAL_MS = 1000;
/** RpcError.code where there is nothing to read. */
const NO_SCENE = -32004;
/** A camera that has not moved for so long rests, and all detail is drawn again. */
const REST_MS = 300;
/** What is read again may be so far from where it was pinned, in distances of the vertex that was read first, and in diagonals of the scene. */
const REACH_OF_DISTANCE = 3;
const REACH_OF_SCENE = 0.01;

type Place = { x: number; y: number };

/** What readings need of the picture. */
interface Picture {
  /** Point of the scene under a place of the canvas (CSS pixels), or null. */
  pick(x: number, y: number): Promise<Vec3 | null>;
  /** Where a point of the scene is on the canvas; null behind the camera. */
  project(point: Vec3): (Place & { depth: number }) | null;
  aimAt(point: Vec3): void;
}

/** What readings need of the session they belong to. */
export interface ReadingsSession {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  onExtremes: (extremes: Extremes | null) => void;
  onProblem: (error: unknown) => void;
  /** Settings are on their way to the server, or it has not answered yet. */
  isBusy: () => boolean;
  /** The nearest vertex of what is drawn, where raw values of it are here; null where not. */
  probeHere: (point: Vec3) => Promise<ProbedVertex | null>;
}

/** What is read of the scene: its histogram and extremes, the place under the pointer, and the one that is pinned; in the store. */
export class Readings {
  readonly #histogramAsker: Coalescer<true>;
  readonly #hoverAsker: Coalescer<Place>;
  readonly #againAsker: Coalescer<true>;
  /** Under the pointer. */
  #hovered: Place | null = null;
  /** Where in the scene the pinned reading was asked for, and from how far a vertex may answer for it. */
  #pinnedAt: { point: Vec3; reach: number } | null = null;
  /** Settings in which the colours of the pinned reading are. */
  #pinnedWith = '';
  /** Counts from where the scene has been looked at. */
  #views = 0;
  #rest: ReturnType<typeof setTimeout> | undefined;
  #shownRevision: number | null = null;
  /** Number of the picture in which something else may be under the pointer. */
  #newPicture = Infinity;

  constructor(
    private readonly store: Store,
    private readonly picture: Picture,
    private readonly session: ReadingsSession,
  ) {
    this.#histogramAsker = new Coalescer({
      send: () => this.#askHistogram(),
      merge: () => true,
      interval_ms: HISTOGRAM_INTERVAL_MS,
      max_in_flight: 1,
    });
    this.#hoverAsker = new Coalescer({
      send: (place) => this.#askHover(place),
      merge: (_earlier, later) => later,
      interval_ms: HOVER_INTERVAL_MS,
      max_in_flight: 1,
    });
    this.#againAsker = new Coalescer({
      send: () => this.#readAgain(),
      merge: () => true,
      interval_ms: AGAIN_INTERVAL_MS,
      max_in_flight: 1,
    });
  }

  /** A new connection: what the one before was asked is not answered any more. */
  beginConnection(): void {
    this.#histogramAsker.reset();
    this.#againAsker.reset();
    // Another server may count from the beginning.
    this.#shownRevision = null;
  }

  /** There is no scene to read. */
  clear(): void {
    this.store.histogram = null;
    this.store.extremes = null;
    this.store.hover = null;
    this.store.pinned = null;
    this.session.onExtremes(null);
  }

  /** Other settings are in force: the histogram is of what they show. */
  askHistogram(): void {
    this.#histogramAsker.push(true);
  }

  /** What is said of the scene beside the picture; the first picture goes before it. */
  askFacts(): void {
    const { store } = this;
    if (!store.scene || !store.pictureStands) return;
    this.askHistogram();
    this.#againAsker.push(true);
    this.session
      .request('scene.extremes', {})
      .then((answer) => {
        store.extremes = extremes(answer, 'scene.extremes');
        this.session.onExtremes(store.extremes);
      })
      .catch(this.session.onProblem);
  }

  /** The hottest and the coldest place of what a camera sees in a part of its picture; null where that cannot be said now. */
  async extremesInView(camera: CameraPose, window: Window): Promise<Extremes | null> {
    const { store } = this;
    if (!store.connected || !store.marksShown || store.server?.capabilities.includes('extremes_in_view') !== true) return null;
    try {
      return extremes(await this.session.request('scene.extremes', { camera, window }), 'scene.extremes');
    } catch (error) {
      // A server that is busy with other things: nothing is marked.
      if (!(error instanceof RpcError)) this.session.onProblem(error);
      return null;
    }
  }

  /** All of this revision of the scene is in the picture of this number, which is yet to be drawn. */
  pictureIsOf(revision: number, picture: number): void {
    if (revision === this.#shownRevision) return;
    this.#shownRevision = revision;
    this.differs(picture);
  }

  /** From the picture of this number on, which is yet to be drawn, another surface is seen: a finer one, say. */
  differs(picture: number): void {
    this.#newPicture = picture;
  }

  /** The pictures up to this number have been drawn: something else may be under the pointer. What is pinned has the colours of now. */
  drawn(picture: number): void {
    const settings = this.#settings;
    if (picture < this.#newPicture && (this.store.pinned === null || settings === this.#pinnedWith)) return;
    if (picture >= this.#newPicture) this.#newPicture = Infinity;
    this.#pinnedWith = settings;
    this.#againAsker.push(true);
  }

  /** The pointer is over this place of the canvas; null when it has left. */
  hover(place: Place | null): void {
    this.#hovered = place;
    if (place === null) {
      this.#hoverAsker.reset();
      this.store.hover = null;
      return;
    }
    if (this.store.connected || this.store.fusingPlace === 'here') this.#hoverAsker.push(place);
  }

  /** Reads the scene at a place of the canvas and keeps the reading on the screen; where nothing is, none is kept. */
  async pin(place: Place): Promise<void> {
    try {
      const point = await this.picture.pick(place.x, place.y);
      if (point === null) {
        this.store.pinned = null;
        return;
      }
      const settings = this.#settings;
      const answer = await this.#probe(point);
      if (answer === null) return;
      this.#pinnedWith = settings;
      this.#pinnedAt = { point, reach: this.#reach(answer) };
      this.store.pinned = { reading: { ...place, probe: answer }, place: this.picture.project(answer.position) };
    } catch (error) {
      this.session.onProblem(error);
    }
  }

  /** Makes the temperatures of now those that later ones are compared with; the scene says when that is done. */
  async markBaseline(): Promise<void> {
    const { store } = this;
    store.baselineRefusal = null;
    store.isMarkingBaseline = true;
    try {
      baseline(await this.session.request('scene.baseline', { action: 'mark' }), 'scene.baseline');
    } catch (error) {
      if (error instanceof RpcError) store.baselineRefusal = error.message;
      else this.session.onProblem(error);
    } finally {
      store.isMarkingBaseline = false;
    }
  }

  unpin(): void {
    this.store.pinned = null;
  }

  /** What is pinned stays at its place in the scene; what is under the pointer is something else, and read once the camera rests. */
  cameraMoved(): void {
    const { pinned } = this.store;
    if (pinned !== null) this.store.pinned = { ...pinned, place: this.picture.project(pinned.reading.probe.position) };
    this.#views += 1;
    this.store.hover = null;
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => this.hover(this.#hovered), REST_MS);
  }

  get #settings(): string {
    return JSON.stringify([this.store.generation, this.store.fusionInForce]);
  }

  async #askHistogram(): Promise<void> {
    const { store, session } = this;
    if (!store.scene || !store.pictureStands) return;
    const { generation } = store;
    // What is shown here is told to the robot later.
    const isTold = () => store.fusingPlace !== 'here' || !session.isBusy();
    const wasTold = isTold();
    try {
      const answer = await session.request('scene.histogram', { bins: HISTOGRAM_BINS });
      const { highlighted, highlighted_share, ...rest } = histogram(answer, 'scene.histogram');
      const { fusionInForce: fusion, histogram: before } = store;
      if (fusion !== null && generation === store.generation && wasTold && isTold()) {
        if (highlighted_share !== undefined) store.highlighting[fusion.method] = true;
        store.histogram = { ...rest, highlighted, ...(highlighted_share === undefined ? {} : { highlighted_share }) };
        store.shareOf = highlightKey(fusion);
      } else if (store.fusingPlace === 'here' && before !== null) {
        store.histogram = { ...before, ...rest };
      } else {
        // Other settings are in force meanwhile, for which it is asked for again.
        store.histogram = { ...rest, highlighted };
        store.shareOf = null;
      }
    } catch (error) {
      this.session.onProblem(error);
    }
  }

  #reach({ distance }: Probe): number {
    const { min, max } = this.store.scene?.bounds ?? { min: [0, 0, 0], max: [0, 0, 0] };
    const diagonal = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
    return Math.max(REACH_OF_DISTANCE * distance, REACH_OF_SCENE * diagonal);
  }

  /** The scene is another one: what is said of a place is of now, and of a place with nothing nothing is said. */
  async #readAgain(): Promise<void> {
    const { store } = this;
    if (!store.connected && store.fusingPlace !== 'here') return;
    if (this.#hovered !== null) this.#hoverAsker.push(this.#hovered);
    const at = this.#pinnedAt;
    if (at === null || store.pinned === null) return;
    let answer: Probe | null = null;
    try {
      answer = await this.#probe(at.point);
    } catch (error) {
      if (error instanceof RpcError && error.code === BUSY) return this.#againAsker.push(true);
      if (!(error instanceof RpcError && error.code === NO_SCENE)) return this.session.onProblem(error);
    }
    if (at !== this.#pinnedAt || store.pinned === null) return;
    if (!store.connected && answer !== null) answer = { ...store.pinned.reading.probe, fused: answer.fused };
    store.pinned =
      answer === null || answer.distance > at.reach
        ? null
        : { reading: { ...store.pinned.reading, probe: answer }, place: this.picture.project(answer.position) };
  }

  /** At full accuracy by the robot; without a link by what is here, if anything is. */
  async #probe(point: Vec3): Promise<Probe | null> {
    if (this.store.connected) return probe(await this.session.request('scene.probe', { position: point }), 'scene.probe');
    const vertex = await this.session.probeHere(point);
    if (vertex === null) return null;
    const { temperature, ...rest } = vertex;
    return {
      ...rest,
      vertex_index: 0,
      temperature: Number.isFinite(temperature) ? temperature : null,
      ...(Math.abs(temperature) === Infinity ? { temperature_range: temperature > 0 ? 'over' : 'under' } : {}),
    };
  }

  async #askHover(place: Place): Promise<void> {
    const view = this.#views;
    try {
      const point = await this.picture.pick(place.x, place.y);
      if (point !== null) this.picture.aimAt(point);
      const answer = point && (await this.#probe(point));
      const isOfNow = view === this.#views && this.#hovered !== null;
      this.store.hover = answer === null || !isOfNow ? null : { ...place, probe: answer };
    } catch {
      this.store.hover = null;
    }
  }
}
