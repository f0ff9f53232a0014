import decoderAddress from 'draco3d/draco_decoder.wasm?url';
import type { SocketLike } from './transport/connection';
import { EarlySocket } from './transport/early_socket';

const SUBPROTOCOL = 'spectra.v1';

/**
 * What the first picture needs beside the program itself: the workers and the connection. Each costs a slow link round trips of its own, so
 * they are asked for while the program is still on its way, and handed over when it is there.
 */

/** True where a worker can draw on a canvas of the page, so that nothing the GPU does keeps the page waiting. */
export const CAN_DRAW_IN_WORKER =
  typeof OffscreenCanvas !== 'undefined' && 'transferControlToOffscreen' in HTMLCanvasElement.prototype;

/** A worker that starts at once and is given once; one that has failed is not given. */
class EarlyWorker {
  #worker: Worker | null = null;

  constructor(private readonly create: () => Worker) {}

  start(): void {
    const worker = this.create();
    this.#worker = worker;
    worker.onerror = () => {
      if (this.#worker === worker) this.#worker = null;
    };
  }

  take(): Worker {
    const worker = this.#worker ?? this.create();
    this.#worker = null;
    return worker;
  }
}

const picture = new EarlyWorker(
  () => new Worker(new URL('./draw/render_worker.ts', import.meta.url), { type: 'module', name: 'picture' }),
);
const draco = new EarlyWorker(
  () => new Worker(new URL('./decode/worker.ts', import.meta.url), { type: 'module', name: 'draco' }),
);
let socket: EarlySocket | null = null;

const openSocket = (url: string): SocketLike => new WebSocket(url, SUBPROTOCOL);

/** Where the server of this page is spoken with. */
export function serverAddress(): string {
  const folder = location.pathname.replace(/[^/]*$/, '');
  // What is the same for everybody, and most of hello, is got in another way when the picture has come.
  return `${location.protocol === 'https:' ? 'wss:' : 'ws:'}//${location.host}${folder}ws?hello=brief`;
}

export function beginHeadStart(): void {
  socket = new EarlySocket(serverAddress(), openSocket);
  if (CAN_DRAW_IN_WORKER) picture.start();
  draco.start();
}

/**
 * The program has come: now the decoder's own, which is behind what the server says first on a slow link, and fills it while that is
 * answered. The worker finds it in the browser's cache.
 */
export function continueHeadStart(): void {
  fetch(new URL(decoderAddress, location.href))
    .then((response) => response.arrayBuffer())
    .catch(() => undefined);
}

/** The worker that draws. */
export const takePictureWorker = (): Worker => picture.take();

/** A worker that decodes. */
export const takeDecodeWorker = (): Worker => draco.take();

/** A socket to the server: the first time the one that has been opened already. */
export const takeSocket = (url: string): SocketLike => socket?.take(url) ?? openSocket(url);
