import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { type PartFailure, PartLoader } from './part_loader';

let loaded: string[];
let failure: PartFailure | null;
let asked: { answer: (part: string) => void; fail: (error: Error) => void }[];
let loader: PartLoader<string>;
const settle = () => vi.advanceTimersByTimeAsync(0);

beforeEach(() => {
  vi.useFakeTimers();
  [loaded, failure, asked] = [[], null, []];
  loader = new PartLoader(() => new Promise<string>((answer, fail) => asked.push({ answer, fail })), {
    onLoaded: (part) => loaded.push(part),
    onFailure: (next) => (failure = next),
  });
});
afterEach(() => vi.useRealTimers());

it('is asked for when it is wanted, and once', async () => {
  loader.retryNow();
  expect(asked).toHaveLength(0);
  loader.want();
  loader.want();
  expect(asked).toHaveLength(1);
  asked[0]!.answer('panel');
  await settle();
  loader.want();
  loader.retryNow();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(asked).toHaveLength(1);
  expect(loaded).toEqual(['panel']);
  expect(failure).toBeNull();
});

it('is asked for again, ever more seldom, and at once when somebody says so', async () => {
  loader.want();
  asked[0]!.fail(new Error('the line is down'));
  await settle();
  expect(failure?.message).toBe('the line is down');
  expect(failure!.retry_at - performance.now()).toBe(250);
  await vi.advanceTimersByTimeAsync(250);
  expect(asked).toHaveLength(2);
  asked[1]!.fail(new Error('still'));
  await settle();
  expect(failure!.retry_at - performance.now()).toBe(500);
  loader.retryNow();
  expect(asked).toHaveLength(3);
  asked[2]!.answer('panel');
  await settle();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(asked).toHaveLength(3);
  expect(loaded).toEqual(['panel']);
  expect(failure).toBeNull();
});

it('is of no use to a page that has gone', async () => {
  loader.want();
  loader.dispose();
  asked[0]!.answer('panel');
  await settle();
  expect(loaded).toEqual([]);

  const other = new PartLoader(() => Promise.reject(new Error('gone')), {
    onLoaded: () => undefined,
    onFailure: (next) => (failure = next),
  });
  other.want();
  await settle();
  other.dispose();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(failure?.message).toBe('gone');
});
