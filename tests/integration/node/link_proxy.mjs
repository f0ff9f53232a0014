// A radio link on loopback: a TCP proxy that gives each direction a rate (shared by all connections), a delay (which a new connection
// has to bear for its handshake too), jitter, and stalls. Like a modem with a bounded queue, it stops reading when its queue is full, so
// that the sender feels the link.
import net from "node:net";

/** One direction of one connection. */
class Lane {
  constructor(from, to, link, line, connection) {
    this.from = from;
    this.to = to;
    this.link = link;
    this.line = line;
    this.connection = connection;
    this.openAt = performance.now() + 2 * link.delay_ms;
    this.queued_bytes = 0;
    this.lastDelivery = 0;
    from.on("data", (chunk) => this.#accept(chunk));
    from.on("end", () => this.#after(this.lastDelivery, () => to.end()));
    from.on("error", () => to.destroy());
    from.on("close", () => this.#after(this.lastDelivery, () => to.destroy()));
  }

  #accept(chunk) {
    const slice_bytes = 1400;
    for (let offset = 0; offset < chunk.length; offset += slice_bytes) {
      this.#send(chunk.subarray(offset, offset + slice_bytes));
    }
    if (this.queued_bytes > this.link.queue_bytes) this.from.pause();
  }

  #send(packet) {
    const { rate_bytes_per_s, delay_ms, jitter_ms, stalledUntil } = this.link;
    const now = performance.now();
    this.queued_bytes += packet.length;
    const { line } = this;
    line.freeAt = Math.max(line.freeAt, now, this.openAt, stalledUntil) + (packet.length / rate_bytes_per_s) * 1000;
    const delivery = line.freeAt + delay_ms + this.link.random() * jitter_ms;
    this.lastDelivery = Math.max(this.lastDelivery, delivery);
    this.#after(line.freeAt, () => {
      this.queued_bytes -= packet.length;
      if (this.queued_bytes <= this.link.queue_bytes / 2) this.from.resume();
    });
    this.#after(this.lastDelivery, () => {
      this.link.delivered_bytes += packet.length;
      if (this.connection) this.connection.received_bytes += packet.length;
      if (!this.to.destroyed) this.to.write(packet);
    });
  }

  #after(time, action) {
    this.link.schedule(time, action);
  }
}

/**
 * Starts a proxy in front of `target_url`; `url` is what a client connects to.
 * rate_bytes_per_s and delay_ms hold for each direction (a round trip is twice the delay).
 */
export async function linkProxy(target_url, { rate_bytes_per_s = Infinity, delay_ms = 0, jitter_ms = 0, queue_bytes = 16_384, seed = 1 } = {}) {
  const target = new URL(target_url);
  const events = [];
  let state = seed;
  const link = {
    rate_bytes_per_s,
    delay_ms,
    jitter_ms,
    queue_bytes,
    stalledUntil: 0,
    delivered_bytes: 0,
    random() {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      return state / 2 ** 32;
    },
    schedule(time, action) {
      events.push({ time, action });
    },
  };
  // One ticking clock keeps the order of equal times; timers of a millisecond each would not.
  const timer = setInterval(() => {
    const now = performance.now();
    const due = [];
    for (let i = 0; i < events.length; ) {
      if (events[i].time <= now) due.push(...events.splice(i, 1));
      else ++i;
    }
    due.sort((a, b) => a.time - b.time);
    for (const { action } of due) action();
  }, 1);

  const sockets = new Set();
  const connections = [];
  const requests = [];
  const lines = { up: { freeAt: 0 }, down: { freeAt: 0 } };
  const proxy = net.createServer({ noDelay: true }, (near) => {
    const far = net.connect({ host: target.hostname, port: Number(target.port), noDelay: true });
    for (const socket of [near, far]) {
      sockets.add(socket);
      socket.on("close", () => sockets.delete(socket));
    }
    const connection = { path: "", received_bytes: 0 };
    connections.push(connection);
    near.once("data", (chunk) => (connection.path = chunk.toString("latin1").split(" ")[1]));
    near.on("data", (chunk) => {
      const [method, path] = chunk.toString("latin1", 0, 300).split(" ");
      if (method === "GET") requests.push(path);
    });
    new Lane(near, far, link, lines.up);
    new Lane(far, near, link, lines.down, connection);
  });
  await new Promise((resolve) => proxy.listen(0, "127.0.0.1", resolve));
  return {
    url: `http://127.0.0.1:${proxy.address().port}`,
    link,
    /** Every connection so far: the path that it asked for first, and how much has come back. */
    connections,
    /** What has been asked for so far, in order. */
    requests,
    /** Nothing passes for that long. */
    stall(duration_ms) {
      link.stalledUntil = performance.now() + duration_ms;
    },
    /** Connections break, as when a robot drives behind a wall. */
    cut() {
      for (const socket of sockets) socket.destroy();
    },
    async close() {
      clearInterval(timer);
      for (const socket of sockets) socket.destroy();
      await new Promise((resolve) => proxy.close(resolve));
    },
  };
}
