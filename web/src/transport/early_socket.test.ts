import { expect, it } from 'vitest';
import type { SocketLike } from './connection';
import { EarlySocket } from './early_socket';

const URL = 'ws://robot/ws';

class FakeSocket implements SocketLike {
  binaryType: BinaryType = 'blob';
  readyState = 1;
  onopen = null;
  onclose = null;
  onerror = null;
  onmessage: ((event: MessageEvent) => void) | null = null;
  closed = false;
  send(): void {}
  close(): void {
    this.closed = true;
  }
  says(data: unknown): void {
    this.onmessage?.({ data } as MessageEvent);
  }
}

function setUp() {
  const socket = new FakeSocket();
  const early = new EarlySocket(URL, () => socket);
  const heard: unknown[] = [];
  const listen = (taken: SocketLike | null) => {
    if (taken !== null) taken.onmessage = ({ data }) => heard.push(data);
  };
  return { socket, early, heard, listen };
}

it('keeps what is said before anyone listens, in order and before what is said afterwards', async () => {
  const { socket, early, heard, listen } = setUp();
  expect(socket.binaryType).toBe('arraybuffer');
  socket.says('hello');
  socket.says('status');
  listen(early.take(URL));
  await Promise.resolve();
  socket.says('result');
  expect(heard).toEqual(['hello', 'status', 'result']);
});

it('says nothing to one who has stopped listening while it tells', async () => {
  const { socket, early, heard } = setUp();
  socket.says('hello');
  socket.says('status');
  const taken = early.take(URL)!;
  taken.onmessage = ({ data }) => {
    heard.push(data);
    taken.onmessage = null;
  };
  await Promise.resolve();
  expect(heard).toEqual(['hello']);
});

it('is given once', () => {
  const { socket, early } = setUp();
  expect(early.take(URL)).toBe(socket);
  expect(early.take(URL)).toBeNull();
  expect(socket.closed).toBe(false);
});

it('is not given when it has ended or leads elsewhere, nor when it could not be opened', () => {
  const ended = setUp();
  ended.socket.readyState = 3;
  expect(ended.early.take(URL)).toBeNull();
  const other = setUp();
  expect(other.early.take('ws://other/ws')).toBeNull();
  expect(other.socket.closed).toBe(true);
  const refused = new EarlySocket(URL, () => {
    throw new Error('refused');
  });
  expect(refused.take(URL)).toBeNull();
});
