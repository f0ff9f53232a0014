// A robot that sends frames to `serve --map live`: what docs/protocol.md, "A stream of frames", says, and nothing of the program's own.
import { readFileSync } from "node:fs";
import path from "node:path";
import WebSocket from "ws";

/** A message: its head, and what that speaks of. */
export function frameMessage(head, body = Buffer.alloc(0)) {
  const text = Buffer.from(typeof head === "string" ? head : JSON.stringify(head));
  const lead = Buffer.alloc(8);
  lead.write("SPF1", "latin1");
  lead.writeUInt32LE(text.length, 4);
  return Buffer.concat([lead, text, body]);
}

export class FrameSender {
  static async connect(url, { protocol = "spectra.frames.v1", headers = {} } = {}) {
    const sender = new FrameSender();
    sender.socket = new WebSocket(`${url.replace(/^http/, "ws").replace(/\/$/, "")}/frames`, protocol, {
      perMessageDeflate: false,
      headers,
    });
    sender.sequence = 0;
    sender.sent = { messages: 0, bytes: 0 };
    sender.answers = new Map();
    sender.waiting = [];
    sender.socket.on("message", (data) => sender.#receive(JSON.parse(data.toString())));
    await new Promise((resolve, reject) => {
      sender.socket.once("open", resolve);
      sender.socket.once("error", reject);
    });
    sender.closed = new Promise((resolve) => sender.socket.once("close", resolve));
    await sender.until(() => sender.hello);
    return sender;
  }

  #receive({ method, params }) {
    if (method === "frames.hello") this.hello = params;
    else this.answers.set(params.sequence, { method, ...params });
    this.credit = params.credit;
    this.waiting = this.waiting.filter(({ is, resolve }) => !is() || resolve());
  }

  until(is, timeout_ms = 30_000) {
    if (is()) return Promise.resolve();
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error("what was waited for did not come")), timeout_ms);
      this.waiting.push({
        is,
        resolve: () => {
          clearTimeout(timer);
          resolve();
        },
      });
    });
  }

  /** Sends without looking at the credit; the sequence of the message. */
  send(head, body) {
    this.sequence += 1;
    const message = Buffer.isBuffer(head) ? head : frameMessage({ sequence: this.sequence, ...head }, body);
    this.socket.send(message);
    this.sent.messages += 1;
    this.sent.bytes += message.length;
    return this.sequence;
  }

  /** The same within the credit. */
  async sendSoon(head, body) {
    await this.until(() => this.sent.messages < this.credit.messages && this.sent.bytes < this.credit.bytes);
    return this.send(head, body);
  }

  async answer(sequence) {
    await this.until(() => this.answers.has(sequence));
    return this.answers.get(sequence);
  }

  /** Sends and waits for the answer. */
  async ask(head, body) {
    return this.answer(await this.sendSoon(head, body));
  }

  close() {
    this.socket.close();
    return this.closed;
  }
}

/** A folder of frames as messages in the order of their time: {head, body}, the calibration first and poses before what needs them. */
export function* messagesOf(folder, { every = 1 } = {}) {
  const lines = (name) =>
    readFileSync(path.join(folder, name), "utf8")
      .split("\n")
      .filter((line) => line.trim() !== "" && !line.startsWith("#"))
      .map((line) => line.trim().split(/\s+/));
  yield { head: { kind: "calibration" }, body: readFileSync(path.join(folder, "calibration.json")) };
  const poses = lines("poses.txt").map((words) => words.map(Number));
  let next = 0;
  const rows = lines("frames.txt").filter((_, i) => i % every === 0);
  for (const [time, depth, color, thermal] of rows) {
    const fresh = [];
    while (next < poses.length && poses[next][0] <= Number(time) + 0.1) fresh.push(poses[next++]);
    if (fresh.length > 0) yield { head: { kind: "poses", poses: fresh } };
    for (const [sensor, name] of Object.entries({ color, depth, thermal })) {
      if (name === undefined || name === "-") continue;
      const encoding = /jpe?g$/.test(name) ? "jpeg" : "png";
      yield { head: { kind: "picture", time: Number(time), sensor, encoding }, body: readFileSync(path.join(folder, name)) };
    }
  }
  yield { head: { kind: "end" } };
}
