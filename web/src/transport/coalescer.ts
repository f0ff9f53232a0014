/** Options of a Coalescer. */
export interface CoalescerOptions<T> {
  /** Sends one change; settles when the other side has answered. */
  send: (change: T) => Promise<unknown>;
  /** The change that has the effect of `earlier` followed by `later`. */
  merge: (earlier: T, later: T) => T;
  /** Least time between two sends; a flush does not wait for it. */
  interval_ms: number;
  /**
   * Instead of that: what comes sooner after another waits until nothing has come for so long, and no longer than `interval_ms`. What comes after
   * such a rest is sent at once.
   */
  rest_ms?: number;
  /** Most unanswered sends; what comes meanwhile is merged. */
  max_in_flight: number;
  /** Called when nothing is waiting and nothing is unanswered. */
  onIdle?: () => void;
}

/**
 * Thins a stream of changes to what the link can answer. The latest value of every key survives, because changes are merged and the
 * last merged change is always sent.
 */
export class Coalescer<T> {
  #pending: T | undefined;
  #inFlight = 0;
  #lastSent = Number.NEGATIVE_INFINITY;
  #pushed = Number.NEGATIVE_INFINITY;
  /** Until when what waits has to be sent, whatever comes. */
  #latest = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #urgent = false;
  #epoch = 0;

  constructor(private readonly options: CoalescerOptions<T>) {}

  /** True while a change waits or is unanswered. */
  get busy(): boolean {
    return this.#pending !== undefined || this.#inFlight > 0;
  }

  push(change: T): void {
    const now = performance.now();
    const { interval_ms, rest_ms = 0 } = this.options;
    if (this.#pending === undefined) this.#latest = now - this.#pushed < rest_ms ? now + interval_ms : now;
    this.#pushed = now;
    this.#pending = this.#pending === undefined ? change : this.options.merge(this.#pending, change);
    this.#pump();
  }

  /** Sends what waits at once: called when a slider is released. */
  flush(): void {
    if (this.#pending === undefined) return;
    this.#urgent = true;
    this.#pump();
  }

  /** What waits; it is not sent any more. */
  take(): T | undefined {
    const pending = this.#pending;
    this.#pending = undefined;
    this.#urgent = false;
    return pending;
  }

  /** Forgets everything: the connection it was meant for is gone. Returns the change that had not been sent. */
  reset(): T | undefined {
    const pending = this.#pending;
    this.#pending = undefined;
    this.#inFlight = 0;
    this.#urgent = false;
    this.#epoch += 1;
    this.#lastSent = Number.NEGATIVE_INFINITY;
    clearTimeout(this.#timer);
    this.#timer = undefined;
    return pending;
  }

  get #due(): number {
    const { interval_ms, rest_ms } = this.options;
    if (rest_ms === undefined) return this.#lastSent + interval_ms;
    return Math.min(this.#pushed + rest_ms, this.#latest);
  }

  #pump(): void {
    if (this.#pending === undefined || this.#inFlight >= this.options.max_in_flight) return;
    const wait = this.#due - performance.now();
    if (wait > 0 && !this.#urgent) {
      this.#timer ??= setTimeout(() => {
        this.#timer = undefined;
        this.#pump();
      }, wait);
      return;
    }
    clearTimeout(this.#timer);
    this.#timer = undefined;
    const change = this.#pending;
    this.#pending = undefined;
    this.#urgent = false;
    this.#inFlight += 1;
    this.#lastSent = performance.now();
    const epoch = this.#epoch;
    const settled = () => {
      if (epoch !== this.#epoch) return;
      this.#inFlight -= 1;
      this.#pump();
      if (!this.busy) this.options.onIdle?.();
    };
    this.options.send(change).then(settled, settled);
  }
}
