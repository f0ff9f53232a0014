// A sender of blocks, written from docs/protocol.md, "A stream of blocks", alone: it keeps to its credit unless it is told not to.
import WebSocket from "ws";

export const PUT = 1;
export const REMOVE = 2;

export function message(sequence, target, body = Buffer.alloc(0), kind = PUT) {
  const name = Buffer.from(target, "utf8");
  const header = Buffer.alloc(20);
  header.write("SPI1", "latin1");
  header.writeUInt8(kind, 4);
  header.writeUInt16LE(name.length, 6);
  header.writeBigUInt64LE(BigInt(sequence), 8);
  header.writeUInt32LE(body.length, 16);
  return Buffer.concat([header, name, body]);
}

export class IngestSender {
  static async connect(url, { subprotocols = ["spectra.ingest.v1"], headers = {} } = {}) {
    const sender = new IngestSender();
    sender.socket = new WebSocket(`${url.replace(/^http/, "ws")}/ingest`, subprotocols, { headers, perMessageDeflate: false });
    sender.closed = new Promise((resolve) => sender.socket.on("close", (code, reason) => resolve({ code, reason: reason.toString() })));
    sender.closed.then(() => sender.#wake());
    sender.socket.on("message", (data) => sender.#received(JSON.parse(data.toString())));
    await new Promise((resolve, reject) => {
      sender.socket.on("unexpected-response", (_, response) => {
        let text = "";
        response.on("data", (chunk) => (text += chunk));
        response.on("end", () => reject(Object.assign(new Error(text), { status: response.statusCode })));
      });
      sender.socket.on("error", reject);
      sender.wakers.push(() => sender.hello && resolve());
    });
    sender.socket.on("error", () => {});
    return sender;
  }

  hello = null;
  credit = { blocks: 0, bytes: 0 };
  sent = { blocks: 0, bytes: 0 };
  sequence = 0;
  /** How often the credit was used up. */
  waits = 0;
  answers = new Map();
  /** In the order in which they came. */
  order = [];
  wakers = [];

  #received({ method, params }) {
    if (method === "ingest.hello") this.hello = params;
    this.credit = params.credit;
    if (params.sequence) {
      this.answers.set(params.sequence, { method, ...params });
      this.order.push(params.sequence);
    }
    this.#wake();
  }

  #wake() {
    for (const waker of this.wakers) waker();
  }

  #when(holds) {
    return new Promise((resolve, reject) => {
      const look = () => {
        if (holds()) resolve();
        else if (this.socket.readyState >= WebSocket.CLOSING) reject(new Error("the connection has ended"));
        else return;
        this.wakers.splice(this.wakers.indexOf(look), 1);
      };
      this.wakers.push(look);
      look();
    });
  }

  /** Sends within the credit, waiting for it where needed; resolves with the sequence. */
  async send(target, body, kind = PUT) {
    const may = () => this.sent.blocks < this.credit.blocks && this.sent.bytes < this.credit.bytes;
    if (!may()) this.waits += 1;
    await this.#when(may);
    return this.sendAnyway(target, body, kind);
  }

  sendAnyway(target, body, kind = PUT) {
    this.sequence += 1;
    const bytes = message(this.sequence, target, body, kind);
    this.sent.blocks += 1;
    this.sent.bytes += bytes.length;
    this.socket.send(bytes);
    return this.sequence;
  }

  async answer(sequence) {
    await this.#when(() => this.answers.has(sequence));
    return this.answers.get(sequence);
  }

  async close() {
    this.socket.close();
    return this.closed;
  }
}
