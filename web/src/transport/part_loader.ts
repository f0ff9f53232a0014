import { backoffDelay } from './connection';

export interface PartFailure {
  message: string;
  /** When it is asked for again, on performance.now()'s clock. */
  retry_at: number;
}

/** Gets a part of the program that the first picture does not need, and asks again until it is there. */
export class PartLoader<Part> {
  #attempt = 0;
  #isLoading = false;
  #isDone = false;
  #retryTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly load: () => Promise<Part>,
    private readonly events: { onLoaded: (part: Part) => void; onFailure: (failure: PartFailure | null) => void },
  ) {}

  /** Does nothing when it is there, or on its way; where it has failed it is asked for now. */
  want(): void {
    if (this.#isDone || this.#isLoading) return;
    clearTimeout(this.#retryTimer);
    this.#isLoading = true;
    this.#attempt += 1;
    this.load()
      .then((part) => {
        if (this.#isDone) return;
        this.#isDone = true;
        this.events.onFailure(null);
        this.events.onLoaded(part);
      })
      .catch((error: unknown) => {
        if (this.#isDone) return;
        const delay = backoffDelay(this.#attempt);
        this.#retryTimer = setTimeout(() => this.want(), delay);
        const message = error instanceof Error ? error.message : String(error);
        this.events.onFailure({ message, retry_at: performance.now() + delay });
      })
      .finally(() => {
        this.#isLoading = false;
      });
  }

  /** Asks now instead of waiting any longer, where it has failed. */
  retryNow(): void {
    if (this.#attempt > 0) this.want();
  }

  dispose(): void {
    this.#isDone = true;
    clearTimeout(this.#retryTimer);
  }
}
