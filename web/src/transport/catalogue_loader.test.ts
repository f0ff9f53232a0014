import { readFileSync } from 'node:fs';
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import type { Catalogue } from '../protocol/messages';
import { type CatalogueFailure, CatalogueLoader } from './catalogue_loader';

const golden = readFileSync(new URL('../../../protocol/golden/http/catalogue.json', import.meta.url), 'utf8');

let loaded: Catalogue[];
let failure: CatalogueFailure | null;
/** Requests that have not been answered: the address, and how to answer. */
let asked: { url: string; signal: AbortSignal; answer: (response: Response) => void; fail: (error: Error) => void }[];
let loader: CatalogueLoader;
const settle = () => vi.advanceTimersByTimeAsync(0);

beforeEach(() => {
  vi.useFakeTimers();
  [loaded, failure, asked] = [[], null, []];
  loader = new CatalogueLoader(
    {
      onLoaded: (catalogue) => loaded.push(catalogue),
      onFailure: (next) => (failure = next),
    },
    (url, options) =>
      new Promise((answer, fail) => {
        const signal = options!.signal!;
        signal.addEventListener('abort', () => fail(signal.reason as Error));
        asked.push({ url: url as string, signal, answer, fail });
      }),
  );
});
afterEach(() => vi.useRealTimers());

it('gets a catalogue once, however often the same one is wanted', async () => {
  loader.want('http://a/1');
  asked[0]!.answer(new Response(golden));
  await settle();
  expect(loaded).toEqual([JSON.parse(golden)]);
  loader.want('http://a/1');
  loader.retryNow();
  await vi.advanceTimersByTimeAsync(100_000);
  expect(asked.length).toBe(1);
});

it('gets the one of another name: the server is another one now', async () => {
  loader.want('http://a/1');
  asked[0]!.answer(new Response(golden));
  await settle();
  loader.want('http://a/2');
  expect(asked.map(({ url }) => url)).toEqual(['http://a/1', 'http://a/2']);
});

it('takes no late answer of a name that is not wanted any more', async () => {
  loader.want('http://a/1');
  loader.want('http://a/2');
  expect(asked[0]!.signal.aborted).toBe(true);
  asked[0]!.answer(new Response(golden));
  await settle();
  expect([loaded, failure]).toEqual([[], null]);
});

it('begins anew on a new connection: the old one may be dead', () => {
  loader.want('http://a/1');
  loader.want('http://a/1');
  expect([asked.length, asked[0]!.signal.aborted, asked[1]!.signal.aborted]).toEqual([2, true, false]);
});

it.each([
  ['an error', () => new Response('no', { status: 404 }), 'the server answered with 404'],
  ['what is no JSON', () => new Response('<html>'), 'JSON'],
  ['what is no catalogue', () => new Response('{"methods":[]}'), 'palettes'],
])('says why and asks again after %s', async (_name, answer, reason) => {
  loader.want('http://a/1');
  asked[0]!.answer(answer());
  await settle();
  expect(failure?.message).toContain(reason);
  expect(failure?.retry_at).toBeGreaterThan(performance.now());
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked.length).toBe(2);
  expect(failure, 'until it is there').not.toBeNull();
  asked[1]!.answer(new Response(golden));
  await settle();
  expect(failure).toBeNull();
  expect(loaded.length).toBe(1);
});

it('asks again later and later, or at once when told to', async () => {
  loader.want('http://a/1');
  for (let i = 0; i < 6; i += 1) {
    asked.at(-1)!.fail(new TypeError('Failed to fetch'));
    await vi.advanceTimersByTimeAsync(5000);
  }
  expect(asked.length).toBe(7);
  asked.at(-1)!.fail(new TypeError('Failed to fetch'));
  await settle();
  loader.retryNow();
  loader.retryNow();
  expect(asked.length).toBe(8);
});

it('gives up what does not come', async () => {
  loader.want('http://a/1');
  await vi.advanceTimersByTimeAsync(60_000);
  expect(failure?.message).toBe('it did not come in time');
});

it('asks for nothing more where none is wanted', async () => {
  loader.want('http://a/1');
  asked[0]!.fail(new TypeError('Failed to fetch'));
  await settle();
  loader.wantNone();
  await vi.advanceTimersByTimeAsync(100_000);
  expect([asked.length, failure]).toEqual([1, null]);
});
