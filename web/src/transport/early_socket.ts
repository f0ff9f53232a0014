import type { SocketLike } from './connection';

const CONNECTING = 0;
const OPEN = 1;

/** A socket that is opened before there is anyone to listen to it: what it says until then is kept. */
export class EarlySocket {
  #socket: SocketLike | null;
  readonly #url: string;
  #unheard: MessageEvent[] = [];

  constructor(url: string, openSocket: (url: string) => SocketLike) {
    this.#url = url;
    try {
      this.#socket = openSocket(url);
      this.#socket.binaryType = 'arraybuffer';
      this.#socket.onmessage = (event) => this.#unheard.push(event);
    } catch {
      this.#socket = null;
    }
  }

  /**
   * The socket, once, for whoever sets its handlers in the same task: they then hear what has been kept. Null when it has been taken, has
   * ended, or is one to another address.
   */
  take(url: string): SocketLike | null {
    const socket = this.#socket;
    this.#socket = null;
    if (socket === null) return null;
    socket.onmessage = null;
    if (url !== this.#url || (socket.readyState !== CONNECTING && socket.readyState !== OPEN)) {
      socket.close();
      return null;
    }
    // Before anything that comes later: that is an event of a task of its own.
    queueMicrotask(() => {
      for (const event of this.#unheard.splice(0)) socket.onmessage?.(event);
    });
    return socket;
  }
}
