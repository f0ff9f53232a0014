import { decodeServerMessage, type Hello, hello, type RpcErrorBody } from '../protocol/messages';

/** RpcError.code of a request that was refused for its rate alone. */
export const BUSY = -32003;

/** The server refused a request. */
export class RpcError extends Error {
  readonly code: number;
  /** Path of the field it is about, such as `params.alpha`. */
  readonly field: string | null;

  constructor(body: RpcErrorBody) {
    super(body.data.reason || body.message);
    this.name = 'RpcError';
    this.code = body.code;
    this.field = body.data.field === '' ? null : body.data.field;
  }
}

/** The connection went away before the answer came. */
export class ConnectionLost extends Error {
  constructor() {
    super('the connection was lost before the answer came');
    this.name = 'ConnectionLost';
  }
}

export type LinkState =
  { phase: 'connecting'; attempt: number } | { phase: 'open' } | { phase: 'waiting'; attempt: number; retry_at: number };

export interface ConnectionEvents {
  onHello: (message: Hello) => void;
  onNotification: (method: string, params: unknown) => void;
  onFrame: (message: ArrayBuffer) => void;
  onState: (state: LinkState) => void;
  /** A message that does not follow the protocol; it is left out. */
  onProtocolError: (error: Error) => void;
  /** Whether much may be on its way: a long message on a slow link looks like silence. */
  expectsMuch: () => boolean;
  /** Time from a request to its answer. */
  onRoundTrip: (round_trip_ms: number) => void;
}

/** The part of WebSocket that is used, so that tests can stand in for it. */
export type SocketLike = Pick<WebSocket, 'binaryType' | 'readyState' | 'send' | 'close'> & {
  onopen: ((event: Event) => void) | null;
  onclose: ((event: CloseEvent) => void) | null;
  onerror: ((event: Event) => void) | null;
  onmessage: ((event: MessageEvent) => void) | null;
};

const OPEN = 1;
const HELLO_TIMEOUT_MS = 6_000;
/**
 * Of a link that was there a moment ago, so many round trips for a socket to open, in which one lost packet is sent again. In a silent link TCP
 * asks again after 1, 3 and 7 s: a new socket asks sooner.
 */
const RETURN_ROUND_TRIPS = 5;
/** A socket opens in so many, and in one more with TLS. */
const OPENING_ROUND_TRIPS = 2;
const RETURN_PATIENCE_MS = 600;
/** The same for every fifth attempt, for a link that has become slow; no attempt of the first ones has more. */
const LONG_RETURN_PATIENCE_MS = 2_000;
/** Attempts with that patience. Browsers hold sockets back after a dozen that came to nothing, for longer than it. */
const HASTY_ATTEMPTS = 10;
/** Those up to here are given this. */
const PATIENT_ATTEMPTS = 14;
const PATIENCE_MS = 4_500;
const CHECK_INTERVAL_MS = 250;
/** A page that has not checked for so long has slept, or stalled; in a hidden one timers run once a second. */
const SLEPT_MS = 2_000;
/** Silence after which the server, which says something every second, is asked for a sign of life. */
export const QUIET_MS = 1_500;
/** Time it has to give one. A cut TCP connection takes seconds to resume; a new one is there at once. */
const ANSWER_MS = 1_500;
/** The same while much may be on its way before it. */
const ANSWER_BEHIND_MUCH_MS = 3_000;
const BACKOFF_FIRST_MS = 250;
/** Wait after an attempt that nobody answered, which has been a wait itself. */
const AFTER_SILENCE_MS = 100;
const BACKOFF_LAST_MS = 5_000;

/** Wait before the next attempt after attempt `attempt` (from 1) was refused or cut, without jitter. */
export function backoffDelay(attempt: number): number {
  return Math.min(BACKOFF_LAST_MS, BACKOFF_FIRST_MS * 2 ** (attempt - 1));
}

/** How long attempt `attempt` (from 1) may take to open a socket; `round_trip_ms` is that of the link that was there a moment ago, null: none was. */
export function openPatience(attempt: number, round_trip_ms: number | null): number {
  if (round_trip_ms === null || attempt > PATIENT_ATTEMPTS) return HELLO_TIMEOUT_MS;
  if (attempt > HASTY_ATTEMPTS) return PATIENCE_MS;
  if (attempt % 5 === 0) return LONG_RETURN_PATIENCE_MS;
  return Math.min(LONG_RETURN_PATIENCE_MS, Math.max(RETURN_PATIENCE_MS, RETURN_ROUND_TRIPS * round_trip_ms));
}

interface OpenRequest {
  sent_at: number;
  resolve: (result: unknown) => void;
  reject: (error: Error) => void;
}

/** One logical connection to the server: it opens sockets until one says hello, notices when it has died, and opens the next. */
export class Connection {
  #socket: SocketLike | null = null;
  #attempt = 0;
  #attemptAt = 0;
  /** What the newest socket took to open. */
  #opening_ms = Infinity;
  /** Of the last connection that was greeted, the shortest that is known; null: there was none. */
  #roundTrip_ms: number | null = null;
  #greeted = false;
  #nextId = 1;
  #requests = new Map<number, OpenRequest>();
  #lastMessageAt = 0;
  #lastCheckAt = 0;
  #askedAt: number | null = null;
  #checkTimer: ReturnType<typeof setInterval> | undefined;
  #retryTimer: ReturnType<typeof setTimeout> | undefined;
  #helloTimer: ReturnType<typeof setTimeout> | undefined;
  #closed = false;

  constructor(
    private readonly url: string,
    private readonly events: ConnectionEvents,
    private readonly openSocket: (url: string) => SocketLike,
  ) {}

  /** When the last message of any kind came, on performance.now()'s clock. */
  get lastMessageAt(): number {
    return this.#lastMessageAt;
  }

  start(): void {
    this.#closed = false;
    this.#open();
  }

  stop(): void {
    this.#closed = true;
    clearTimeout(this.#retryTimer);
    this.#drop();
  }

  /** Opens now instead of waiting for the back-off to pass; does nothing when the connection is up. */
  retryNow(): void {
    if (this.#closed || this.#socket !== null) return;
    clearTimeout(this.#retryTimer);
    this.#open();
  }

  request(method: string, params: object): Promise<unknown> {
    const socket = this.#socket;
    if (!this.#greeted || socket === null || socket.readyState !== OPEN) return Promise.reject(new ConnectionLost());
    const id = this.#nextId;
    this.#nextId += 1;
    return new Promise((resolve, reject) => {
      this.#requests.set(id, { sent_at: performance.now(), resolve, reject });
      socket.send(JSON.stringify({ jsonrpc: '2.0', id, method, params }));
    });
  }

  /** Dropped when there is no connection. */
  notify(method: string, params: object): void {
    const socket = this.#socket;
    if (!this.#greeted || socket === null || socket.readyState !== OPEN) return;
    socket.send(JSON.stringify({ jsonrpc: '2.0', method, params }));
  }

  #open(): void {
    this.#attempt += 1;
    this.#attemptAt = performance.now();
    this.#greeted = false;
    this.events.onState({ phase: 'connecting', attempt: this.#attempt });
    let socket: SocketLike;
    try {
      socket = this.openSocket(this.url);
    } catch {
      this.#retryLater();
      return;
    }
    this.#socket = socket;
    socket.binaryType = 'arraybuffer';
    socket.onmessage = (event) => this.#receive(event.data);
    socket.onclose = () => this.#lost();
    socket.onerror = null;
    this.#opening_ms = Infinity;
    socket.onopen = () => {
      this.#opening_ms = performance.now() - this.#attemptAt;
      this.#expectHello(HELLO_TIMEOUT_MS);
    };
    this.#expectHello(socket.readyState === OPEN ? HELLO_TIMEOUT_MS : openPatience(this.#attempt, this.#roundTrip_ms));
  }

  #expectHello(patience_ms: number): void {
    clearTimeout(this.#helloTimer);
    if (!this.#greeted) this.#helloTimer = setTimeout(() => this.#lost(true), patience_ms);
  }

  #receive(data: unknown): void {
    this.#lastMessageAt = performance.now();
    this.#askedAt = null;
    if (data instanceof ArrayBuffer) {
      if (this.#greeted) this.events.onFrame(data);
      return;
    }
    try {
      const message = decodeServerMessage(String(data));
      if (message.type === 'notification') {
        if (message.method === 'hello') this.#greet(hello(message.params, 'hello'));
        else if (this.#greeted) this.events.onNotification(message.method, message.params);
        return;
      }
      const id = typeof message.id === 'number' ? message.id : -1;
      const request = this.#requests.get(id);
      if (request === undefined) {
        if (message.type === 'error') this.events.onProtocolError(new RpcError(message.error));
        return;
      }
      this.#requests.delete(id);
      const roundTrip_ms = performance.now() - request.sent_at;
      this.#roundTrip_ms = Math.min(this.#roundTrip_ms ?? Infinity, roundTrip_ms);
      this.events.onRoundTrip(roundTrip_ms);
      if (message.type === 'result') request.resolve(message.result);
      else request.reject(new RpcError(message.error));
    } catch (error) {
      this.events.onProtocolError(error instanceof Error ? error : new Error(String(error)));
    }
  }

  #greet(message: Hello): void {
    clearTimeout(this.#helloTimer);
    this.#greeted = true;
    this.#roundTrip_ms = Math.min(LONG_RETURN_PATIENCE_MS, this.#opening_ms / OPENING_ROUND_TRIPS);
    this.#attempt = 0;
    this.#lastCheckAt = performance.now();
    clearInterval(this.#checkTimer);
    this.#checkTimer = setInterval(() => this.#check(), CHECK_INTERVAL_MS);
    this.events.onState({ phase: 'open' });
    this.events.onHello(message);
  }

  #check(): void {
    const now = performance.now();
    // After a stalled or sleeping page messages may be waiting behind this timer: the time for an answer begins anew.
    const late = now - this.#lastCheckAt > SLEPT_MS;
    this.#lastCheckAt = now;
    if (late) {
      if (this.#askedAt !== null) this.#askedAt = now;
      return;
    }
    if (this.#askedAt !== null) {
      if (now - this.#askedAt > (this.events.expectsMuch() ? ANSWER_BEHIND_MUCH_MS : ANSWER_MS)) this.#lost();
      return;
    }
    if (now - this.#lastMessageAt > QUIET_MS) {
      this.#askedAt = now;
      this.request('fusion.get', {}).catch(() => undefined);
    }
  }

  #lost(wasSilent = false): void {
    this.#drop();
    if (!this.#closed) this.#retryLater(wasSilent);
  }

  #drop(): void {
    clearTimeout(this.#helloTimer);
    clearInterval(this.#checkTimer);
    const socket = this.#socket;
    this.#socket = null;
    this.#greeted = false;
    this.#askedAt = null;
    if (socket !== null) {
      socket.onopen = null;
      socket.onmessage = null;
      socket.onclose = null;
      socket.close();
    }
    const requests = [...this.#requests.values()];
    this.#requests.clear();
    for (const request of requests) request.reject(new ConnectionLost());
  }

  #retryLater(wasSilent = false): void {
    const attempt = Math.max(1, this.#attempt);
    const hasWaited = wasSilent || (this.#attempt > 0 && performance.now() - this.#attemptAt >= LONG_RETURN_PATIENCE_MS);
    const delay = (hasWaited ? AFTER_SILENCE_MS : backoffDelay(attempt)) * (0.75 + 0.5 * Math.random());
    this.events.onState({ phase: 'waiting', attempt, retry_at: performance.now() + delay });
    this.#retryTimer = setTimeout(() => this.#open(), delay);
  }
}
