import type { FrameIntake } from '../tiles/frame_intake';
import { CLAIM_VALUES, type TileSet } from '../tiles/tile_set';
import type { CatalogueLoader } from '../transport/catalogue_loader';
import { type FusionChange, type Hello, type Quality, type Scene, subscribed } from '../protocol/messages';
import type { Fusing } from './fusing';
import type { FirstLook } from '../view/first_look';
import { cacheBytes } from './cache_bytes';
import type { Progress } from './progress';
import type { QualityWish } from './quality_wish';
import type { Readings } from './readings';
import type { Settings } from './settings';
import type { Store } from './store.svelte';

/** Most tiles that scene.subscribe may claim; what is held beyond them comes again. */
const MOST_CLAIMED = 1500;
/** What a message may hold, less what else is in it. */
const MOST_VALUES = 9900;

/** What a connection's beginning concerns. */
export interface Concerned {
  tiles: Pick<TileSet, 'size' | 'clear' | 'claims' | 'layersOf' | 'resume'>;
  intake: Pick<FrameIntake, 'beginConnection'>;
  settings: Pick<Settings, 'greeted' | 'send' | 'busy' | 'reconsiderMissing'>;
  quality: Pick<QualityWish, 'greeted' | 'send' | 'askMarks' | 'sceneHasStep'>;
  readings: Pick<Readings, 'beginConnection' | 'clear' | 'askFacts'>;
  progress: Pick<Progress, 'begin'>;
  look: Pick<FirstLook, 'sceneIs'>;
  catalogue: Pick<CatalogueLoader, 'want' | 'wantNone'>;
  fusing: Pick<Fusing, 'greeted' | 'channels' | 'step_celsius' | 'sceneGone'>;
}

/** What the subscription needs of the session it belongs to. */
export interface SubscriptionSession {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  /** Tells the server where the camera is. */
  tellCamera: () => void;
  /** There is something for the next picture. */
  invalidate: () => void;
  onProblem: (error: unknown) => void;
}

/** From a server's hello to its stream: what was held and wished on the connection before goes on, and the scene is what the server says. */
export class Subscription {
  #connectionNumber = 0;
  /** Where methods and palettes are; null when it is known, or being asked for. */
  #catalogueAddress: string | null = null;
  /** Session whose server knows what the tile set claims. */
  #claimableSession: string | null = null;
  /** The stream of this connection has been asked for. */
  #isSubscribed = false;

  /** `url`: of the socket. */
  constructor(
    private readonly store: Store,
    private readonly url: string,
    private readonly concerned: Concerned,
    private readonly session: SubscriptionSession,
  ) {}

  greeted(message: Hello): void {
    const { store } = this;
    const { settings, quality, readings, intake, progress, catalogue } = this.concerned;
    const returning = store.scene !== undefined;
    store.pictureMethod ??= store.otherMethods[0] ?? store.shownMethods[0] ?? null;
    this.#connectionNumber += 1;
    this.#isSubscribed = false;
    readings.beginConnection();

    store.server = message;
    if ('catalogue' in message) {
      this.#catalogueAddress = new URL(message.catalogue, this.url.replace(/^ws/, 'http')).href;
      // The first picture goes before it.
      if (returning) this.linkIsFree();
    } else {
      this.#catalogueAddress = null;
      catalogue.wantNone();
      store.methods = message.methods;
      store.palettes = message.palettes;
    }
    if (message.scene === null) this.linkIsFree();
    const fusionBefore = settings.greeted(message.fusion, returning);
    const qualityBefore = quality.greeted(message.quality, returning);
    store.lostAt = null;
    store.statuses = [];
    store.complete = null;
    intake.beginConnection();
    this.#setScene(message.scene, true);
    this.concerned.fusing.greeted(message.capabilities);
    this.session.tellCamera();
    progress.begin();
    void this.#subscribe(message, fusionBefore, qualityBefore);
    settings.reconsiderMissing();
    // Before the stream, which is asked for at the end of this task at the earliest.
    quality.askMarks();
  }

  /** The server says that its scene is another one, or has changed. */
  sceneChanged(scene: Scene | null): void {
    this.#setScene(scene, false);
    this.concerned.settings.reconsiderMissing();
    this.concerned.progress.begin();
  }

  /** Other channels are wanted; nothing that is here comes again. */
  async channelsChanged(): Promise<void> {
    const greeting = this.store.server;
    if (greeting === null || !this.#isSubscribed) return;
    try {
      await this.session.request('scene.subscribe', this.#params(greeting.capabilities));
    } catch (error) {
      this.session.onProblem(error);
    }
  }

  /** What the first picture takes has come, or there will be none: now it is the turn of the rest. */
  linkIsFree(): void {
    this.store.isLinkFree = true;
    const address = this.#catalogueAddress;
    this.#catalogueAddress = null;
    if (address !== null) this.concerned.catalogue.want(address);
  }

  /** Asks for the stream right behind the user's settings: it begins when they are in force again, in their colours and accuracy. */
  async #subscribe(greeting: Hello, fusion: FusionChange | null, quality: Quality | null): Promise<void> {
    const { settings, tiles } = this.concerned;
    const connectionNumber = this.#connectionNumber;
    const isOver = () => connectionNumber !== this.#connectionNumber;
    const told = Promise.all([fusion && settings.send(fusion), quality && this.concerned.quality.send(quality)]);
    void told.then(() => {
      if (!isOver() && !settings.busy) this.store.wanted = null;
    });
    await Promise.resolve();
    if (isOver()) return;
    const session_id = this.#claimableSession;
    const claims = session_id !== null && greeting.capabilities.includes('resume') ? tiles.claims(MOST_CLAIMED, MOST_VALUES) : [];
    const layers = tiles.layersOf(claims, MOST_VALUES - CLAIM_VALUES * claims.length, this.concerned.fusing.step_celsius);
    if (!greeting.capabilities.includes('raw_layers')) layers.raw = [];
    try {
      this.#isSubscribed = true;
      const answer = await this.session.request('scene.subscribe', {
        ...this.#params(greeting.capabilities),
        ...(claims.length > 0 ? { resume: { session_id, tiles: claims, ...layers } } : {}),
      });
      if (isOver()) return;
      const { resumed_tiles = 0, current_colours = [], generation = 0 } = subscribed(answer, 'scene.subscribe');
      tiles.resume(claims, resumed_tiles > 0, layers, { places: current_colours, generation });
      this.#claimableSession = greeting.session_id;
      this.session.invalidate();
    } catch (error) {
      this.session.onProblem(error);
    }
  }

  #params(capabilities: readonly string[]): object {
    const isHatched = this.store.hatchAbove_kelvin !== null && capabilities.includes('temperature_sigma');
    return {
      channels: [...this.concerned.fusing.channels, ...(isHatched ? ['temperature_sigma'] : [])],
      // As usual where it is not said.
      temperature_step_celsius: this.concerned.fusing.step_celsius,
      ...(capabilities.includes('cache_bytes')
        ? { cache_bytes: cacheBytes((navigator as Navigator & { deviceMemory?: number }).deviceMemory) }
        : {}),
      ...(capabilities.includes('subtract_green') ? { colour_transform: 'subtract_green' } : {}),
    };
  }

  #setScene(next: Scene | null, fresh: boolean): void {
    const { store } = this;
    const { tiles, look, readings, quality, fusing } = this.concerned;
    const before = store.scene;
    store.scene = next;
    if (next === null) {
      fusing.sceneGone();
      tiles.clear();
      look.sceneIs(null);
      readings.clear();
      this.session.invalidate();
      return;
    }
    const same = before?.name === next.name;
    // A running connection says itself what goes; what a new one does not know of must go when it is of another scene.
    if (fresh && before && !(same && JSON.stringify(before.origin) === JSON.stringify(next.origin))) {
      fusing.sceneGone();
      tiles.clear();
    }
    if (tiles.size === 0) store.pictureRevision = next.revision;
    else if (fresh) store.pictureRevision = -1;
    look.sceneIs(next);
    quality.sceneHasStep(next.position_step_m);
    if (!same) {
      store.pinned = null;
      store.pictureMethod = null;
    }
    readings.askFacts();
  }
}
