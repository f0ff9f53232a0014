import { describe, expect, it } from 'vitest';
import type { DecodeJob, DecodeResult, WorkerReply, WorkerRequest } from './messages';
import { DecodePool, Superseded } from './pool';

class FakeWorker {
  onmessage: ((event: MessageEvent<WorkerReply>) => void) | null = null;
  onerror: ((event: ErrorEvent) => void) | null = null;
  requests: WorkerRequest[] = [];
  terminated = false;
  postMessage(request: WorkerRequest): void {
    this.requests.push(request);
  }
  terminate(): void {
    this.terminated = true;
  }
  /** Answers the oldest request with its first payload byte. */
  finish(error?: string): void {
    const request = this.requests.shift();
    if (request === undefined) throw new Error('nothing was asked');
    const result: DecodeResult = { kind: 'colours', rgba: request.job.payload };
    this.onmessage?.({
      data: error === undefined ? { id: request.id, result } : { id: request.id, error },
    } as MessageEvent<WorkerReply>);
  }
}

const job = (byte: number): DecodeJob => ({ kind: 'colours', payload: Uint8Array.from([byte]), transform: 'none' });
const byteOf = (result: DecodeResult) => (result.kind === 'colours' ? result.rgba[0] : undefined);

function setUp(count: number) {
  const workers: FakeWorker[] = [];
  const pool = new DecodePool(() => {
    const worker = new FakeWorker();
    workers.push(worker);
    return worker as unknown as Worker;
  }, count);
  return { pool, workers };
}

describe('DecodePool', () => {
  it('gives every worker one job at a time, in order', async () => {
    const { pool, workers } = setUp(2);
    const results = [1, 2, 3].map((byte) => pool.decode(`tile ${byte}`, job(byte)));
    expect(workers.map(({ requests }) => requests.length)).toEqual([1, 1]);
    expect(pool.pending).toBe(3);
    workers[1]?.finish();
    expect(byteOf(await (results[1] as Promise<DecodeResult>))).toBe(2);
    expect(workers[1]?.requests[0]?.job.payload[0]).toBe(3);
  });

  it('decodes only the newest of waiting jobs for one tile', async () => {
    const { pool, workers } = setUp(1);
    const running = pool.decode('tile', job(1));
    const older = pool.decode('tile', job(2));
    const newest = pool.decode('tile', job(3));
    await expect(older).rejects.toBeInstanceOf(Superseded);
    workers[0]?.finish();
    workers[0]?.finish();
    expect([byteOf(await running), byteOf(await newest)]).toEqual([1, 3]);
  });

  it('goes on after a job that fails', async () => {
    const { pool, workers } = setUp(1);
    const bad = pool.decode('a', job(1));
    const good = pool.decode('b', job(2));
    workers[0]?.finish('not Draco');
    await expect(bad).rejects.toThrow('not Draco');
    workers[0]?.finish();
    expect(byteOf(await good)).toBe(2);
  });

  it('drops what waits when it is cleared and ends its workers when disposed of', async () => {
    const { pool, workers } = setUp(1);
    const running = pool.decode('a', job(1));
    const waiting = pool.decode('b', job(2));
    pool.clear();
    await expect(waiting).rejects.toBeInstanceOf(Superseded);
    workers[0]?.finish();
    expect(byteOf(await running)).toBe(1);
    pool.dispose();
    expect(workers[0]?.terminated).toBe(true);
  });
});
