import type { DecodeJob, DecodeResult, WorkerReply, WorkerRequest } from './messages';

/** A job was dropped because a newer one for the same key made it useless. */
export class Superseded extends Error {
  constructor() {
    super('superseded by a newer frame');
    this.name = 'Superseded';
  }
}

interface QueuedJob {
  key: string;
  job: DecodeJob;
  resolve: (result: DecodeResult) => void;
  reject: (error: Error) => void;
}

interface PoolWorker {
  worker: Worker;
  busy: QueuedJob | null;
}

/** Spreads Draco jobs over workers. Jobs start in order; of queued jobs with one key only the newest is decoded. */
export class DecodePool {
  #workers: PoolWorker[];
  #queue: QueuedJob[] = [];
  #nextId = 1;

  constructor(
    createWorker: () => Worker,
    workerCount: number = Math.max(1, Math.min(4, (navigator.hardwareConcurrency || 2) - 1)),
  ) {
    this.#workers = Array.from({ length: workerCount }, () => {
      const entry: PoolWorker = { worker: createWorker(), busy: null };
      entry.worker.onmessage = (event: MessageEvent<WorkerReply>) => this.#finish(entry, event.data);
      entry.worker.onerror = (event) => this.#finish(entry, { id: 0, error: event.message || 'the decode worker failed' });
      return entry;
    });
  }

  /** Jobs that wait or run. */
  get pending(): number {
    return this.#queue.length + this.#workers.filter((entry) => entry.busy !== null).length;
  }

  /** Decodes; the payload's buffer is moved away. `key` names what a newer job would replace. */
  decode(key: string, job: DecodeJob): Promise<DecodeResult> {
    return new Promise((resolve, reject) => {
      const queued: QueuedJob = { key, job, resolve, reject };
      const older = this.#queue.findIndex((other) => other.key === key);
      if (older >= 0) {
        this.#queue[older]?.reject(new Superseded());
        this.#queue[older] = queued;
      } else {
        this.#queue.push(queued);
      }
      this.#pump();
    });
  }

  /** Drops what waits: its connection is gone. */
  clear(): void {
    const queue = this.#queue;
    this.#queue = [];
    for (const queued of queue) queued.reject(new Superseded());
  }

  dispose(): void {
    this.clear();
    for (const { worker } of this.#workers) worker.terminate();
    this.#workers = [];
  }

  #pump(): void {
    for (const entry of this.#workers) {
      if (entry.busy !== null) continue;
      const next = this.#queue.shift();
      if (next === undefined) return;
      entry.busy = next;
      const request: WorkerRequest = { id: this.#nextId, job: next.job };
      this.#nextId += 1;
      entry.worker.postMessage(request, [next.job.payload.buffer]);
    }
  }

  #finish(entry: PoolWorker, reply: WorkerReply): void {
    const queued = entry.busy;
    entry.busy = null;
    if (queued !== null) {
      if ('error' in reply) queued.reject(new Error(reply.error));
      else queued.resolve(reply.result);
    }
    this.#pump();
  }
}
