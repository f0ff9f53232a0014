// Clients that mean harm, for soak.mjs and attacks.mjs; alone:
//   node tests/soak/hostile.mjs URL ATTACK SECONDS [TOKEN]      ("all" takes turns until the time is up)
// Ends with one line of JSON: what was sent, and what came back by its status or close code.
import { randomBytes } from "node:crypto";
import { once } from "node:events";
import net from "node:net";
import os from "node:os";
import { fileURLToPath } from "node:url";

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** One target and what is counted of it. */
class Aim {
  constructor(url, seconds, token) {
    const { hostname, port, host } = new URL(url);
    Object.assign(this, { hostname, port: Number(port), host, token, until: performance.now() + 1000 * seconds, counts: {} });
  }
  count(what, times = 1) {
    this.counts[what] = (this.counts[what] ?? 0) + times;
  }
  get goesOn() {
    return performance.now() < this.until;
  }
  /** A socket whose end and answers are counted; null where none can be had. */
  connect({ reads = true } = {}) {
    return new Promise((resolve) => {
      const socket = net.connect({ host: this.hostname, port: this.port });
      socket.once("connect", () => {
        this.count("connects");
        resolve(socket);
      });
      socket.on("error", () => {
        this.count("reset");
        resolve(null);
      });
      if (reads) {
        socket.on("data", (chunk) => {
          const status = /^HTTP\/1\.1 (\d+)/.exec(chunk.toString("latin1", 0, 16));
          if (status) this.count(status[1]);
        });
      } else {
        socket.pause();
      }
    });
  }
  header(line, ...more) {
    const lines = [line, `Host: ${this.host}`, ...(this.token ? [`Authorization: Bearer ${this.token}`] : []), ...more];
    return `${lines.join("\r\n")}\r\n\r\n`;
  }
  upgrade() {
    return this.header("GET /ws?hello=brief HTTP/1.1", "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: spectra.v1");
  }
}

/** Until a socket takes more, or has ended. */
async function drained(socket) {
  const stop = new AbortController();
  await Promise.race([once(socket, "drain", { signal: stop.signal }), once(socket, "close", { signal: stop.signal }), sleep(1000)]).catch(() => {});
  stop.abort();
}

/** A client's frame, masked with zeros. */
function frame(opcode, payload) {
  const body = Buffer.from(payload);
  const head = Buffer.alloc(body.length < 126 ? 6 : 8);
  head[0] = 0x80 | opcode;
  if (body.length < 126) {
    head[1] = 0x80 | body.length;
  } else {
    head[1] = 0xfe;
    head.writeUInt16BE(body.length, 2);
  }
  return Buffer.concat([head, body]);
}

const text = (method, params, id = 1) => frame(1, JSON.stringify({ jsonrpc: "2.0", id, method, params }));

/** A viewer who has upgraded, or null. */
async function viewer(aim, options) {
  const socket = await aim.connect(options);
  if (!socket) return null;
  socket.write(aim.upgrade());
  await sleep(100);
  return socket.destroyed ? null : socket;
}

export const ATTACKS = {
  /** 1,000 connections of one address that say nothing. */
  async connections(aim) {
    const sockets = new Set();
    while (aim.goesOn) {
      while (sockets.size < 1000 && aim.goesOn) {
        const batch = await Promise.all(Array.from({ length: 50 }, () => aim.connect()));
        for (const socket of batch) {
          if (!socket) continue;
          sockets.add(socket);
          socket.once("close", () => sockets.delete(socket));
        }
        await sleep(10);
      }
      await sleep(100);
    }
    for (const socket of sockets) socket.destroy();
  },
  /** 200 clients who send a header byte by byte. */
  async slow_headers(aim) {
    const one = async () => {
      while (aim.goesOn) {
        const socket = await aim.connect();
        if (!socket) return;
        socket.write(`GET / HTTP/1.1\r\nHost: ${aim.host}\r\nX-Slow: `);
        while (aim.goesOn && !socket.destroyed && socket.writable) {
          socket.write("a");
          await sleep(1000);
        }
        socket.destroy();
      }
    };
    await Promise.all(Array.from({ length: 200 }, one));
  },
  /** Uploads of 1 GB, as fast as they go. */
  async upload(aim) {
    const chunk = randomBytes(1 << 20);
    while (aim.goesOn) {
      const socket = await aim.connect();
      if (!socket) continue;
      socket.write(aim.header("PUT /api/v1/blocks/huge HTTP/1.1", "Content-Type: application/octet-stream", "Transfer-Encoding: chunked"));
      for (let sent = 0; sent < 1 << 30 && aim.goesOn && socket.writable && !socket.destroyed; sent += chunk.length) {
        const is_taken = socket.write(`${chunk.length.toString(16)}\r\n`) && socket.write(chunk);
        socket.write("\r\n");
        aim.count("sent_mb");
        if (!is_taken) await drained(socket);
      }
      socket.destroy();
      await sleep(10);
    }
  },
  /** JSON 100,000 deep, over four connections, without end. */
  async deep_json(aim) {
    const body = Buffer.from("[".repeat(100_000));
    const head = Buffer.alloc(14);
    head[0] = 0x81;
    head[1] = 0xff;
    head.writeBigUInt64BE(BigInt(body.length), 2);
    const bomb = Buffer.concat([head, body]);
    const fitting = frame(1, "[".repeat(60_000));
    const one = async (message) => {
      while (aim.goesOn) {
        const socket = await viewer(aim);
        while (socket && aim.goesOn && !socket.destroyed && socket.writable) {
          aim.count("bombs");
          if (!socket.write(message)) await drained(socket);
          await sleep(1);
        }
        socket?.destroy();
        await sleep(50);
      }
    };
    await Promise.all([one(bomb), one(bomb), one(fitting), one(fitting)]);
  },
  /** 10,000 requests a second, over 20 connections. */
  async requests(aim) {
    const ask = aim.header("GET /healthz HTTP/1.1");
    const sockets = [];
    const begin = performance.now();
    let sent = 0;
    while (aim.goesOn) {
      for (let i = 0; i < 20; i += 1) if (!sockets[i] || sockets[i].destroyed) sockets[i] = await aim.connect();
      const due = Math.floor(((performance.now() - begin) / 1000) * 10_000);
      for (let i = 0; sent < due; i = (i + 1) % 20) {
        if (sockets[i] && sockets[i].writableLength < 1 << 16) {
          sockets[i].write(ask.repeat(10));
          aim.count("requests", 10);
        }
        sent += 10;
      }
      await sleep(5);
    }
    for (const socket of sockets) socket?.destroy();
  },
  /** 20 viewers who ask for everything and read nothing. */
  async stalled(aim) {
    const sockets = await Promise.all(Array.from({ length: 20 }, () => viewer(aim, { reads: false })));
    for (const socket of sockets) socket?.write(text("scene.subscribe", { channels: ["fused"] }));
    for (let i = 0; aim.goesOn; i += 1) {
      for (const socket of sockets) {
        if (socket && !socket.destroyed && socket.writableLength < 1000) socket.write(text("fusion.set", { params: { alpha: (i % 97) / 97 } }, i));
      }
      await sleep(1000);
    }
    for (const socket of sockets) socket?.destroy();
  },
  /** Noise before and after the upgrade. */
  async garbage(aim) {
    while (aim.goesOn) {
      const bare = await aim.connect();
      bare?.write(randomBytes(2000));
      const upgraded = await viewer(aim);
      upgraded?.write(randomBytes(2000));
      await sleep(50);
      bare?.destroy();
      upgraded?.destroy();
    }
  },
  /** Wrong tokens, as fast as answers come. */
  async wrong_tokens(aim) {
    const one = async () => {
      while (aim.goesOn) {
        const socket = await aim.connect();
        if (!socket) continue;
        const token = `spectra_operator_${randomBytes(16).toString("hex")}`;
        socket.write(`GET /metrics HTTP/1.1\r\nHost: ${aim.host}\r\nAuthorization: Bearer ${token}\r\nConnection: close\r\n\r\n`);
        await Promise.race([new Promise((resolve) => socket.once("close", resolve)), sleep(2000)]);
        socket.destroy();
      }
    };
    await Promise.all(Array.from({ length: 4 }, one));
  },
  /** Connects and closes, 500 a second. */
  async connect_storm(aim) {
    while (aim.goesOn) {
      const batch = await Promise.all(Array.from({ length: 25 }, () => aim.connect()));
      for (const socket of batch) socket?.destroy();
      await sleep(50);
    }
  },
  /** One who changes settings and asks for histograms without reading an answer. */
  async changes_unread(aim) {
    while (aim.goesOn) {
      const socket = await viewer(aim, { reads: false });
      socket?.write(text("scene.subscribe", { channels: ["fused"] }));
      for (let i = 0; socket && aim.goesOn && !socket.destroyed; i += 1) {
        if (socket.writableLength < 1 << 16) {
          socket.write(text("fusion.set", { method: "thermal_visible_blend", params: { alpha: (i % 997) / 997 } }, i));
          socket.write(text("scene.histogram", { bins: 4096 }, i));
        }
        await sleep(10);
      }
      socket?.destroy();
      await sleep(100);
    }
  },
};

/** Runs an attack for that long; returns the counts. */
export async function attack(url, name, seconds, token) {
  const aim = new Aim(url, seconds, token);
  if (name !== "all") {
    await ATTACKS[name](aim);
    return aim.counts;
  }
  const counts = {};
  const end = performance.now() + 1000 * seconds;
  for (let turn = 0; performance.now() < end; turn += 1) {
    const names = Object.keys(ATTACKS);
    const which = names[turn % names.length];
    const length_s = Math.min(20, (end - performance.now()) / 1000);
    const of_turn = new Aim(url, length_s, turn % 2 ? token : undefined);
    await ATTACKS[which](of_turn);
    const sum = (counts[which] ??= {});
    for (const [what, times] of Object.entries(of_turn.counts)) sum[what] = (sum[what] ?? 0) + times;
  }
  return counts;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [, , url, name, seconds, token] = process.argv;
  if (name !== "all" && !ATTACKS[name]) throw new Error(`there are: all, ${Object.keys(ATTACKS).join(", ")}`);
  // It stands for another machine, which takes nothing of this one's processor.
  os.setPriority(19);
  console.log(JSON.stringify(await attack(url, name, Number(seconds), token || undefined)));
  process.exit(0);
}
