import { type Quality, type QualityChange, qualityState } from '../protocol/messages';
import { Coalescer } from '../transport/coalescer';
import { RpcError } from '../transport/connection';
import type { Store } from './store.svelte';

/** Least time between two changes. */
const INTERVAL_MS = 33;

/** What the quality needs of the session it belongs to. */
export interface QualitySession {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  /** Another accuracy was asked for: the picture is behind until it is shown. */
  onChange: () => void;
  onRefusal: (error: RpcError) => void;
  /** Anything but a refusal. */
  onProblem: (error: unknown) => void;
}

/** How accurate the picture is to be, and whether its colours say what is highlighted: what is wished, and what is in force. */
export class QualityWish {
  readonly #sender: Coalescer<QualityChange>;
  #isChosen = false;
  /** What this connection was last asked for. */
  #asksMarks = false;

  constructor(
    private readonly store: Store,
    private readonly session: QualitySession,
  ) {
    this.#sender = new Coalescer({
      send: (change) => this.send(change),
      merge: (earlier, later) => ({ ...earlier, ...later }),
      interval_ms: INTERVAL_MS,
      max_in_flight: 1,
    });
  }

  /** The user wishes it so. */
  set(change: QualityChange): void {
    this.#isChosen = true;
    if (this.store.quality !== null) this.store.quality = { ...this.store.quality, ...change };
    this.#sender.push(change);
  }

  /**
   * A new connection with its own quality. Returns the user's, when `isReturning` and there is any: it is to be sent before anything
   * is drawn, and is shown until then.
   */
  greeted(quality: Quality, isReturning: boolean): Quality | null {
    const before = isReturning && this.#isChosen ? this.store.quality : null;
    this.#sender.reset();
    this.store.quality = before ?? quality;
    this.#asksMarks = this.store.quality.marks;
    return before;
  }

  /** The scene's own step is what a user gets who has chosen none. */
  sceneHasStep(step_m: number): void {
    if (!this.#isChosen && this.store.quality !== null)
      this.store.quality = { ...this.store.quality, position_step_mm: step_m * 1000 };
  }

  /** Unless lines around what is highlighted are off, the colours say what that is, so that automatic can compare it with the rest. */
  askMarks(): void {
    const marks = this.store.outlineWish !== 'off';
    if (this.store.server?.capabilities.includes('marks') !== true || marks === this.#asksMarks) return;
    this.#asksMarks = marks;
    void this.send({ marks });
  }

  /** Sends a change at once and takes in the answer; never rejects. */
  async send(change: QualityChange): Promise<void> {
    try {
      const wire: Partial<Quality> = { mode: this.store.quality?.mode ?? 'manual', ...change };
      this.session.onChange();
      this.store.quality = qualityState(await this.session.request('quality.set', wire), 'quality.set').quality;
    } catch (error) {
      if (error instanceof RpcError) this.session.onRefusal(error);
      else this.session.onProblem(error);
    }
  }
}
