import { readFileSync } from 'node:fs';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { backoffDelay, Connection, ConnectionLost, type LinkState, openPatience, RpcError, type SocketLike } from './connection';

const helloText = readFileSync(new URL('../../../protocol/golden/messages/hello.notification.json', import.meta.url), 'utf8');

class FakeSocket implements SocketLike {
  binaryType: BinaryType = 'blob';
  readyState = 1;
  onopen: ((event: Event) => void) | null = null;
  onclose: ((event: CloseEvent) => void) | null = null;
  onerror = null;
  onmessage: ((event: MessageEvent) => void) | null = null;
  sent: { id?: number; method: string; params: unknown }[] = [];
  closed = false;
  send(text: unknown): void {
    this.sent.push(JSON.parse(String(text)) as { id?: number; method: string; params: unknown });
  }
  close(): void {
    this.closed = true;
    this.readyState = 3;
  }
  receive(data: unknown): void {
    this.onmessage?.({ data } as MessageEvent);
  }
  answer(result: unknown): void {
    this.receive(JSON.stringify({ jsonrpc: '2.0', id: this.sent.at(-1)?.id, result }));
  }
}

function setUp(expectsMuch = false) {
  const sockets: FakeSocket[] = [];
  const states: LinkState[] = [];
  const frames: ArrayBuffer[] = [];
  const notes: string[] = [];
  const problems: string[] = [];
  const link = { isSilent: false };
  let hellos = 0;
  const connection = new Connection(
    'ws://robot/ws',
    {
      onHello: () => (hellos += 1),
      onNotification: (method) => notes.push(method),
      onFrame: (message) => frames.push(message),
      onState: (state) => states.push(state),
      onProtocolError: (error) => problems.push(error.message),
      expectsMuch: () => expectsMuch,
      onRoundTrip: () => undefined,
    },
    () => {
      const socket = new FakeSocket();
      socket.readyState = link.isSilent ? 0 : 1;
      sockets.push(socket);
      return socket;
    },
  );
  connection.start();
  const last = () => sockets.at(-1) as FakeSocket;
  return { connection, link, sockets, states, frames, notes, problems, last, hellos: () => hellos };
}

describe('Connection', () => {
  beforeEach(() => vi.useFakeTimers());
  afterEach(() => {
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  it('is open after hello, and asks and answers by id', async () => {
    const { connection, states, last } = setUp();
    await expect(connection.request('scene.get', {})).rejects.toBeInstanceOf(ConnectionLost);
    last().receive(helloText);
    expect(states.at(-1)).toEqual({ phase: 'open' });
    const answer = connection.request('scene.get', {});
    last().answer({ name: 'x' });
    await expect(answer).resolves.toEqual({ name: 'x' });
  });

  it('turns a refusal into an error that names the field', async () => {
    const { connection, last } = setUp();
    last().receive(helloText);
    const answer = connection.request('fusion.set', { params: { alpha: 7 } });
    const id = last().sent.at(-1)?.id;
    last().receive(
      JSON.stringify({
        jsonrpc: '2.0',
        id,
        error: { code: -32602, message: 'no', data: { field: 'params.alpha', reason: 'above 1' } },
      }),
    );
    const error = await answer.catch((e: unknown) => e);
    expect(error).toBeInstanceOf(RpcError);
    expect(error).toMatchObject({ field: 'params.alpha', message: 'above 1', code: -32602 });
  });

  it('asks for a sign of life in silence and leaves a link that gives none', async () => {
    const { sockets, states, last } = setUp();
    last().receive(helloText);
    await vi.advanceTimersByTimeAsync(2000);
    expect(last().sent.map(({ method }) => method)).toEqual(['fusion.get']);
    await vi.advanceTimersByTimeAsync(4000);
    expect(sockets[0]?.closed).toBe(true);
    expect(states.some(({ phase }) => phase === 'waiting')).toBe(true);
    await vi.advanceTimersByTimeAsync(1000);
    expect(sockets.length).toBe(2);
  });

  it('leaves a silent link after three seconds and a bit, later where much may be on its way', async () => {
    for (const [expectsMuch, last_ms] of [
      [false, 3_500],
      [true, 5_000],
    ] as const) {
      const { sockets, last } = setUp(expectsMuch);
      last().receive(helloText);
      await vi.advanceTimersByTimeAsync(last_ms - 600);
      expect(sockets[0]?.closed).toBe(false);
      await vi.advanceTimersByTimeAsync(600);
      expect(sockets[0]?.closed).toBe(true);
    }
  });

  it('leaves a silent link in a hidden page, whose timers run once a second', async () => {
    const { sockets, last } = setUp();
    const real = performance.now.bind(performance);
    let skipped_ms = 0;
    vi.spyOn(performance, 'now').mockImplementation(() => real() + skipped_ms);
    last().receive(helloText);
    for (let i = 0; i < 6; i += 1) {
      skipped_ms += 800;
      await vi.advanceTimersByTimeAsync(250);
    }
    expect(sockets[0]?.closed).toBe(true);
  });

  it('does not take a link for dead because the page slept', async () => {
    const { sockets, last } = setUp();
    const awake = performance.now.bind(performance);
    let slept_ms = 0;
    vi.spyOn(performance, 'now').mockImplementation(() => awake() + slept_ms);
    last().receive(helloText);
    await vi.advanceTimersByTimeAsync(2000);
    expect(last().sent).toHaveLength(1);
    // The answer comes while the page sleeps; when it wakes up its timers may run before the message is handed out.
    slept_ms = 60_000;
    await vi.advanceTimersByTimeAsync(500);
    expect(sockets[0]?.closed).toBe(false);
    last().answer({});
    await vi.advanceTimersByTimeAsync(1000);
    expect(sockets).toHaveLength(1);
    // One that gives no sign of life after that is dead all the same.
    await vi.advanceTimersByTimeAsync(5000);
    expect(sockets[0]?.closed).toBe(true);
  });

  it('stays with a link that answers', async () => {
    const { sockets, last } = setUp();
    last().receive(helloText);
    for (let i = 0; i < 20; i += 1) {
      await vi.advanceTimersByTimeAsync(1000);
      const asked = last().sent.at(-1);
      if (asked !== undefined) last().answer({});
    }
    expect(sockets.length).toBe(1);
  });

  it('takes frames as a sign of life', async () => {
    const { sockets, frames, last } = setUp();
    last().receive(helloText);
    for (let i = 0; i < 10; i += 1) {
      await vi.advanceTimersByTimeAsync(1000);
      last().receive(new ArrayBuffer(8));
    }
    expect(frames).toHaveLength(10);
    expect(last().sent).toEqual([]);
    expect(sockets.length).toBe(1);
  });

  it('rejects what was asked when the link goes, and comes back', async () => {
    const { connection, sockets, states, last, hellos } = setUp();
    last().receive(helloText);
    const answer = connection.request('scene.get', {});
    last().onclose?.({} as CloseEvent);
    await expect(answer).rejects.toBeInstanceOf(ConnectionLost);
    expect(states.at(-1)?.phase).toBe('waiting');
    await vi.advanceTimersByTimeAsync(400);
    expect(sockets.length).toBe(2);
    last().receive(helloText);
    expect(hellos()).toBe(2);
  });

  it('gives up on a socket that never says hello', async () => {
    const { sockets } = setUp();
    await vi.advanceTimersByTimeAsync(6500);
    expect(sockets[0]?.closed).toBe(true);
    expect(sockets.length).toBe(2);
  });

  it('reports and survives messages that break the protocol', () => {
    const { problems, notes, last } = setUp();
    last().receive(helloText);
    for (const text of ['no json', '[]', '{"jsonrpc":"1.0"}', '{"jsonrpc":"2.0","id":1}']) last().receive(text);
    expect(problems).toHaveLength(4);
    last().receive('{"jsonrpc":"2.0","method":"something.new","params":{}}');
    expect(notes).toEqual(['something.new']);
  });

  it('waits longer from attempt to attempt, to a limit', () => {
    const delays = Array.from({ length: 12 }, (_, i) => backoffDelay(i + 1));
    expect(delays[0]).toBe(250);
    expect(delays.at(-1)).toBe(5000);
    for (let i = 1; i < delays.length; i += 1) expect(delays[i]).toBeGreaterThanOrEqual(delays[i - 1] ?? 0);
  });

  it('asks a silent link anew as soon as a socket would have opened once it was there, and gives every fifth attempt more time', async () => {
    const { connection, link, sockets, last } = setUp();
    last().receive(helloText);
    for (const round_trip_ms of [150, 250]) {
      const answer = connection.request('fusion.get', {});
      await vi.advanceTimersByTimeAsync(round_trip_ms);
      last().answer({});
      await answer;
    }
    link.isSilent = true;
    const begun: number[] = [];
    for (let passed = 0; passed < 35_000; passed += 10) {
      const before = sockets.length;
      await vi.advanceTimersByTimeAsync(10);
      if (sockets.length > before) begun.push(passed);
    }
    expect(begun.length).toBeGreaterThanOrEqual(15);
    for (let attempt = 1; attempt < begun.length; attempt += 1) {
      const apart = (begun[attempt] ?? 0) - (begun[attempt - 1] ?? 0);
      expect(apart).toBeGreaterThanOrEqual(openPatience(attempt, 150) + 65);
      expect(apart).toBeLessThanOrEqual(openPatience(attempt, 150) + 135);
    }
  });

  it('knows the round trip of a link by how long its socket took to open', async () => {
    const { link, sockets, last } = setUp();
    link.isSilent = true;
    const untilThereAre = async (count: number) => {
      const begin = performance.now();
      while (sockets.length < count) await vi.advanceTimersByTimeAsync(10);
      return performance.now() - begin;
    };
    await untilThereAre(2);
    await vi.advanceTimersByTimeAsync(400);
    last().onopen?.({} as Event);
    last().receive(helloText);
    await untilThereAre(3);
    const apart_ms = await untilThereAre(4);
    expect(apart_ms).toBeGreaterThan(5 * 200 + 50);
    expect(apart_ms).toBeLessThan(5 * 210 + 150);
  });

  it('has what a browser lets it try within a few minutes for half of a minute without a link', () => {
    const until = (attempts: number) =>
      Array.from({ length: attempts }, (_, i) => openPatience(i + 1, 120) + 100).reduce((sum, wait) => sum + wait, 0);
    expect(until(10)).toBeGreaterThan(8_000);
    expect(until(14)).toBeGreaterThan(25_000);
  });

  it('gives a socket that has opened time to say hello', async () => {
    const { sockets, last } = setUp();
    last().receive(helloText);
    last().onclose?.({} as CloseEvent);
    await vi.advanceTimersByTimeAsync(400);
    expect(sockets).toHaveLength(2);
    last().onopen?.({} as Event);
    await vi.advanceTimersByTimeAsync(5_500);
    expect(last().closed).toBe(false);
    last().receive(helloText);
    await vi.advanceTimersByTimeAsync(1_000);
    expect(sockets).toHaveLength(2);
  });

  it('is patient with a link that it has never had, and with one that has long been gone', () => {
    expect(openPatience(1, null)).toBe(6_000);
    expect([1, 2, 4, 5, 9, 10].map((attempt) => openPatience(attempt, 5))).toEqual([600, 600, 600, 2_000, 600, 2_000]);
    expect([1, 5].map((attempt) => openPatience(attempt, 300))).toEqual([1_500, 2_000]);
    expect(openPatience(1, 900)).toBe(2_000);
    expect([11, 12, 14].map((attempt) => openPatience(attempt, 5))).toEqual([4_500, 4_500, 4_500]);
    expect(openPatience(15, 5)).toBe(6_000);
  });

  it('opens nothing after stop', async () => {
    const { connection, sockets, last } = setUp();
    last().receive(helloText);
    connection.stop();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(sockets.length).toBe(1);
  });
});
