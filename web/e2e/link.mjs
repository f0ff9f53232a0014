// A link between browser and server that can be slow and can be cut.
import { createServer, connect } from 'node:net';

const STEP_MS = 10;

/** Listens on a port of its own and passes everything on to `port`. */
export async function startLink(port) {
  let bytes_per_s = Infinity;
  let isDown = false;
  let toBrowser_bytes = 0;
  const pairs = new Set();

  const server = createServer((browser) => {
    if (isDown) {
      browser.destroy();
      return;
    }
    const upstream = connect(port, '127.0.0.1');
    const pair = { browser, upstream, queue: [], timer: undefined };
    pairs.add(pair);
    const end = () => {
      clearInterval(pair.timer);
      pairs.delete(pair);
      browser.destroy();
      upstream.destroy();
    };
    for (const socket of [browser, upstream]) {
      socket.setNoDelay(true);
      socket.on('error', end);
      socket.on('close', end);
    }
    browser.on('data', (chunk) => upstream.write(chunk));
    const write = (chunk) => {
      toBrowser_bytes += chunk.length;
      browser.write(chunk);
    };
    upstream.on('data', (chunk) => {
      if (bytes_per_s === Infinity && pair.queue.length === 0) write(chunk);
      else {
        pair.queue.push(chunk);
        upstream.pause();
      }
    });
    pair.timer = setInterval(() => {
      let allowance = (bytes_per_s * STEP_MS) / 1000;
      while (pair.queue.length > 0 && allowance > 0) {
        const chunk = pair.queue.shift();
        if (chunk.length > allowance) pair.queue.unshift(chunk.subarray(Math.ceil(allowance)));
        write(chunk.subarray(0, Math.ceil(allowance)));
        allowance -= chunk.length;
      }
      if (pair.queue.length === 0) upstream.resume();
    }, STEP_MS);
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));

  return {
    url: `http://127.0.0.1:${server.address().port}/`,
    /** Bytes that have gone to the browser. */
    get bytes() {
      return toBrowser_bytes;
    },
    /** Bytes a second towards the browser; Infinity = as fast as it goes. */
    set rate(value) {
      bytes_per_s = value;
    },
    /** Ends every connection and, until `up()`, refuses new ones. */
    down: () => {
      isDown = true;
      for (const { browser, upstream } of pairs) {
        browser.destroy();
        upstream.destroy();
      }
    },
    up: () => {
      isDown = false;
    },
    stop: () => {
      isDown = true;
      for (const { browser, upstream } of pairs) {
        browser.destroy();
        upstream.destroy();
      }
      return new Promise((resolve) => server.close(resolve));
    },
  };
}
