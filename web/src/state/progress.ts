import type { StreamComplete } from '../protocol/messages';
import type { Shown } from '../tiles/frame_intake';
import type { Store } from './store.svelte';

/** Since when a revision is missing is kept to this share of the time since the oldest is: of a map that is never complete there are a few hundred. */
const EXACT_SHARE = 0.01;
/** Over which the rate is taken. */
const RATE_MS = 2000;

/** What is asked of the tiles. */
interface Tiles {
  readonly size: number;
  /** How many show the newest settings. */
  progress(generation: number): { current: number; total: number };
}

/** What is known of the settings that were made here. */
interface Settings {
  /** Some are still on their way to the server. */
  readonly busy: boolean;
  /** Of those that it has answered last. */
  readonly answeredGeneration: number;
}

/** How far the picture is behind what was asked for, what it cost, and what the link brings meanwhile; in the store. */
export class Progress {
  /** What the picture is behind of, the oldest first: from when on, of which revision of the scene, and how many bytes had come by then. */
  #missing: { at: number; revision: number; bytes: number }[] = [];
  #window: { at: number; bytes: number }[] = [];
  /** Settings that are shown here and are in no picture yet, by the number of the picture that they will be in. */
  #here: { picture: number; method: string; at: number }[] = [];
  /** Pictures that are complete once they have been drawn. */
  #complete: { picture: number; message: StreamComplete }[] = [];
  #shown: { picture: number; shown: Shown }[] = [];
  /** What the picture is behind of are settings alone. */
  #mayBeRefused = false;

  constructor(
    private readonly store: Store,
    private readonly tiles: Tiles,
    private readonly settings: Settings,
    private readonly now: () => number = () => performance.now(),
  ) {}

  /** Another picture was asked for, or announced. `mayBeRefused`: by settings, of which the server may want no other picture. */
  begin(mayBeRefused = false): void {
    // There will be no picture.
    if (this.store.scene === null) return this.#notBehind();
    const isBehind = this.store.behindSince !== null;
    this.#mayBeRefused = mayBeRefused && (!isBehind || this.#mayBeRefused);
    const { revision } = this.store.scene ?? { revision: 0 };
    const [at, oldest, newest] = [this.now(), this.#missing[0], this.#missing.at(-1)];
    if (newest !== undefined && at - newest.at < EXACT_SHARE * (at - oldest!.at))
      newest.revision = Math.max(newest.revision, revision);
    if ((newest?.revision ?? -1) >= revision) return;
    this.#missing.push({ at, revision, bytes: this.store.received_bytes });
    this.store.behindSince = this.#missing[0]!.at;
  }

  received(bytes: number): void {
    this.store.received_bytes += bytes;
    this.#window.push({ at: this.now(), bytes });
  }

  /** All that was asked for is in the picture of this number. */
  completed(message: StreamComplete, picture: number): void {
    this.#complete.push({ picture, message });
  }

  /** All that had changed by a revision is in the picture of this number. */
  shows(shown: Shown, picture: number): void {
    if (this.#missing.length > 1) this.#shown.push({ picture, shown });
  }

  /** What has changed since remains. */
  #showsUpTo({ generation, scene_revision }: Shown): void {
    // A map that grows may have another range, and with it another generation, all the time.
    if (generation < this.settings.answeredGeneration || this.settings.busy) return;
    const newest = this.#missing.at(-1);
    this.#missing = this.#missing.filter((one) => one.revision > scene_revision || one === newest);
    this.store.behindSince = this.#missing[0]?.at ?? null;
  }

  #completed(message: StreamComplete): void {
    const { store } = this;
    store.complete = message;
    store.pictureRevision = message.scene_revision;
    if (message.generation < store.generation || this.settings.busy) return;
    if (!store.isOfOldScene) return this.#caughtUp();
    // Of a map that grows all the time.
    this.#showsUpTo(message);
    this.#methodIsShown();
  }

  /** A method is shown by what is here, in the picture of this number. */
  beginHere(method: string, picture: number): void {
    const last = this.#here.at(-1);
    if (last?.picture === picture) last.method = method;
    else this.#here.push({ picture, method, at: this.now() });
    this.store.hereSince = this.#here[0]!.at;
  }

  /** The pictures up to this number have been drawn. */
  drawn(picture: number): void {
    for (const { message } of this.#complete.filter((one) => one.picture <= picture)) this.#completed(message);
    this.#complete = this.#complete.filter((one) => one.picture > picture);
    for (const { shown } of this.#shown.filter((one) => one.picture <= picture)) this.#showsUpTo(shown);
    this.#shown = this.#shown.filter((one) => one.picture > picture);
    const drawn = this.#here.filter((one) => one.picture <= picture).at(-1);
    if (drawn === undefined) return;
    this.#here = this.#here.filter((one) => one.picture > picture);
    this.store.pictureMethod = drawn.method;
    this.store.hereSince = this.#here[0]?.at ?? null;
    if (this.store.lateSince === null) this.store.progress = 1;
  }

  /** Nothing is made here any more. */
  leftHere(): void {
    this.#here = [];
    this.store.hereSince = null;
  }

  /** Nothing comes any more: there is nothing to be behind of. */
  disconnected(): void {
    this.#complete = [];
    this.#shown = [];
    this.#notBehind();
    this.store.rate_bytes_per_s = 0;
  }

  tick(): void {
    const { store } = this;
    const now = this.now();
    this.#window = this.#window.filter(({ at }) => now - at < RATE_MS);
    store.rate_bytes_per_s = (this.#window.reduce((sum, { bytes }) => sum + bytes, 0) / RATE_MS) * 1000;
    // What was refused changes no picture: nothing more comes.
    const isShown = store.complete !== null && store.complete.generation >= store.generation;
    if (this.#mayBeRefused && isShown && !this.settings.busy) this.#caughtUp();
    // What is made here comes into the picture all at once.
    if (store.hereSince !== null || store.factsSince !== null) store.progress = 0;
    else if (store.behindSince !== null) store.progress = this.#share();
  }

  #caughtUp(): void {
    const { store } = this;
    const oldest = this.#missing[0];
    if (oldest !== undefined) store.lastUpdate = { bytes: store.received_bytes - oldest.bytes, ms: this.now() - oldest.at };
    this.#notBehind();
    store.progress = 1;
    this.#methodIsShown();
  }

  #methodIsShown(): void {
    const { store } = this;
    if (store.hereSince === null && store.factsSince === null) store.pictureMethod = store.fusionInForce?.method ?? null;
  }

  #notBehind(): void {
    this.#missing = [];
    this.store.behindSince = null;
    this.#mayBeRefused = false;
  }

  #share(): number {
    const { store } = this;
    // The server has not said yet which generation shows the method that is named.
    if (store.fusion?.method !== store.fusionInForce?.method) return 0;
    // Before the first picture is complete nobody can say which tiles it takes; at most it is all of them.
    if (store.complete === null && store.otherMethods.length === 0)
      return this.tiles.size / Math.max(1, this.tiles.size, store.scene?.tile_count ?? 0);
    const { current, total } = this.tiles.progress(store.generation);
    return total === 0 ? 0 : current / total;
  }
}
