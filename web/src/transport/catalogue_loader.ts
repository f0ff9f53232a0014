import { type Catalogue, catalogue } from '../protocol/messages';
import { backoffDelay } from './connection';

/** A link on which this is too short for 45 kB shows no picture either. */
const TIMEOUT_MS = 60_000;

export interface CatalogueFailure {
  message: string;
  /** When it is asked for again, on performance.now()'s clock. */
  retry_at: number;
}

/** Gets what a brief hello leaves away, and asks again until it is there. */
export class CatalogueLoader {
  #wanted: string | null = null;
  #isHeld = false;
  #attempt = 0;
  #request: AbortController | null = null;
  #retryTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly events: { onLoaded: (loaded: Catalogue) => void; onFailure: (failure: CatalogueFailure | null) => void },
    private readonly get: typeof fetch = (url, options) => fetch(url, options),
  ) {}

  /** From this address, which changes with the content: does nothing when it is there. What was under way on an older connection begins anew. */
  want(url: string): void {
    if (url === this.#wanted && this.#isHeld) return;
    this.#stop();
    if (url !== this.#wanted) this.events.onFailure(null);
    this.#wanted = url;
    this.#isHeld = false;
    this.#attempt = 0;
    void this.#load(url);
  }

  /** None is wanted: the server has said it all by itself. */
  wantNone(): void {
    this.#stop();
    this.#wanted = null;
    this.events.onFailure(null);
  }

  /** Asks now instead of waiting any longer; does nothing where it is there, or on its way. */
  retryNow(): void {
    if (this.#wanted === null || this.#isHeld || this.#request !== null) return;
    clearTimeout(this.#retryTimer);
    void this.#load(this.#wanted);
  }

  dispose(): void {
    this.wantNone();
  }

  #stop(): void {
    clearTimeout(this.#retryTimer);
    this.#request?.abort();
    this.#request = null;
  }

  async #load(url: string): Promise<void> {
    const request = new AbortController();
    const timer = setTimeout(() => request.abort(new Error('it did not come in time')), TIMEOUT_MS);
    this.#request = request;
    this.#attempt += 1;
    try {
      const response = await this.get(url, { signal: request.signal });
      if (!response.ok) throw new Error(`the server answered with ${response.status}`);
      const loaded = catalogue(await response.json(), 'catalogue');
      if (request !== this.#request) return;
      this.#isHeld = true;
      this.events.onFailure(null);
      this.events.onLoaded(loaded);
    } catch (error) {
      if (request !== this.#request) return;
      const delay = backoffDelay(this.#attempt);
      this.#retryTimer = setTimeout(() => this.retryNow(), delay);
      const message = error instanceof Error ? error.message : String(error);
      this.events.onFailure({ message, retry_at: performance.now() + delay });
    } finally {
      clearTimeout(timer);
      if (request === this.#request) this.#request = null;
    }
  }
}
