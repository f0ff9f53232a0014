// A viewer whose connections are the web client's own: it notices a dead link, opens the next connection and goes on there as the web client
// does, which asks for its settings and, right behind them, for the stream, with the tiles that it still has and the frames that coloured them.
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";
import { isColours, KIND, readFrame } from "../integration/node/spectra_client.mjs";

const root = fileURLToPath(new URL("../../", import.meta.url));
const WebSocket = createRequire(`${root}tests/integration/node/package.json`)("ws");
const { build } = createRequire(`${root}web/package.json`)("esbuild");
const bundled = await build({ entryPoints: [`${root}web/src/transport/connection.ts`], bundle: true, format: "esm", write: false });
const { Connection } = await import(`data:text/javascript;base64,${Buffer.from(bundled.outputFiles[0].contents).toString("base64")}`);

export class WebViewer {
  greeted_at = 0; // on performance.now()'s clock
  attempts = 0; // sockets that it has opened
  frames = 0; // that have come
  #connection;
  #held = new Map(); // tile -> {claim, colourSequence: null until there are colours, 0 where those of an earlier connection were named}
  #session = null;
  #alpha = null;
  #isComplete = true;
  #generation = 0;
  #completed = -1; // the newest generation of this connection that is all there
  #resolve = () => {};

  constructor(url) {
    this.#connection = new Connection(
      `${url.replace(/^http/, "ws")}/ws?hello=brief`,
      {
        onHello: (hello) => void this.#greeted(hello).catch(() => {}),
        onNotification: (method, params) => this.#notified(method, params),
        onFrame: (message) => this.#received(readFrame(Buffer.from(message))),
        onState: () => {},
        onProtocolError: (error) => console.warn(error.message),
        expectsMuch: () => !this.#isComplete,
        onRoundTrip: () => {},
      },
      (address) => {
        this.attempts += 1;
        const socket = new WebSocket(address, "spectra.v1", { perMessageDeflate: false });
        socket.on("error", () => {});
        return socket;
      },
    );
    this.#connection.start();
  }

  stop() {
    this.#connection.stop();
  }

  /** Resolves with the whole picture of a setting, whatever happens to the link meanwhile. */
  show(alpha) {
    this.#alpha = alpha;
    this.#isComplete = false;
    const picture = new Promise((resolve) => (this.#resolve = resolve));
    // Without a connection it is the next one that asks for it.
    void this.#ask().catch(() => {});
    return picture;
  }

  async #ask() {
    this.#generation = Infinity;
    const { generation } = await this.#connection.request("fusion.set", { method: "thermal_visible_blend", params: { alpha: this.#alpha } });
    this.#generation = generation;
    this.#look();
  }

  async #greeted({ session_id }) {
    this.greeted_at = performance.now();
    this.#completed = -1;
    void this.#ask().catch(() => {});
    const claimed = [...this.#held].filter(([, { colourSequence }]) => colourSequence !== null);
    const resume = {
      session_id: this.#session,
      tiles: claimed.map(([, { claim }]) => claim),
      colours: claimed.map(([, { colourSequence }], place) => [place, colourSequence]),
    };
    // Before the answer, as what follows it is newer.
    this.#held = new Map(claimed.map(([tile, { claim }]) => [tile, { claim, colourSequence: 0 }]));
    const before = [...this.#held];
    const isClaiming = this.#session !== null && claimed.length > 0;
    const asked = { channels: ["fused"], colour_transform: "subtract_green", ...(isClaiming ? { resume } : {}) };
    const { resumed_tiles } = await this.#connection.request("scene.subscribe", asked);
    if (!resumed_tiles) for (const [tile, held] of before) if (this.#held.get(tile) === held) this.#held.delete(tile);
    this.#session = session_id;
  }

  #notified(method, params) {
    if (method !== "stream.complete") return;
    this.#completed = params.generation;
    this.#look();
  }

  /** Several messages may come at once: which generation is waited for may be known after it is complete. */
  #look() {
    if (this.#completed < this.#generation) return;
    this.#isComplete = true;
    this.#resolve();
  }

  #received(frame) {
    const { tile, kind, sequence } = frame;
    this.frames += 1;
    if (kind === KIND.geometry) this.#held.set(tile, { claim: [frame.level, ...frame.position, frame.revision], colourSequence: null });
    else if (kind === KIND.remove) this.#held.delete(tile);
    else if (isColours(frame) && this.#held.has(tile)) this.#held.get(tile).colourSequence = sequence;
    this.#connection.notify("stream.ack", { sequence });
  }
}
