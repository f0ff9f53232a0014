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
import { RpcError } from '../transport/connection';
import type { ProbedVertex } from '../draw/render_messages';
import type { Window } from '../view/markers';
import type { Store } from './store.svelte';

const HISTOGRAM_BINS = 192;
const HISTOGRAM_INTERVAL_MS = 100;
const HOVER_INTERVAL_MS = 120;

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
  /** The nearest vertex of what is drawn, where raw values of it are here; null where not. */
  probeHere: (point: Vec3) => Promise<ProbedVertex | null>;
}

/** What is read of the scene: its histogram and extremes, the place under the pointer, and the one that is pinned; in the store. */
export class Readings {
  readonly #histogramAsker: Coalescer<true>;
  readonly #hoverAsker: Coalescer<Place>;
  #isHovering = false;

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
  }

  /** A new connection: what the one before was asked is not answered any more. */
  beginConnection(): void {
    this.#histogramAsker.reset();
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

  /** The pointer is over this place of the canvas; null when it has left. */
  hover(place: Place | null): void {
    this.#isHovering = place !== null;
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
      const answer = await this.#probe(point);
      if (answer === null) return;
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

  /** What is pinned stays at its place in the scene. */
  cameraMoved(): void {
    const { pinned } = this.store;
    if (pinned !== null) this.store.pinned = { ...pinned, place: this.picture.project(pinned.reading.probe.position) };
  }

  async #askHistogram(): Promise<void> {
    if (!this.store.scene || !this.store.pictureStands) return;
    try {
      const answer = await this.session.request('scene.histogram', { bins: HISTOGRAM_BINS });
      const found = histogram(answer, 'scene.histogram');
      const method = this.store.fusionInForce?.method;
      if (found.highlighted_share !== undefined && method !== undefined) this.store.highlighting[method] = true;
      this.store.histogram = found;
    } catch (error) {
      this.session.onProblem(error);
    }
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
    try {
      const point = await this.picture.pick(place.x, place.y);
      if (point !== null) this.picture.aimAt(point);
      const answer = point && (await this.#probe(point));
      this.store.hover = answer === null || !this.#isHovering ? null : { ...place, probe: answer };
    } catch {
      this.store.hover = null;
    }
  }
}
