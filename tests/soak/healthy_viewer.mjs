// A viewer as it should be: subscribes, changes a setting now and then, waits for the whole picture of it, and comes back when its
// connection breaks.
import { SpectraClient } from "../integration/node/spectra_client.mjs";

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export function percentile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;
}

export class HealthyViewer {
  /** Resolves once it has its first whole picture. */
  static async start(url, options = {}) {
    const viewer = new HealthyViewer(url, options);
    await viewer.#connect();
    viewer.ended = viewer.#run();
    return viewer;
  }

  constructor(url, { seed = 0, interval_ms = 1000, patience_ms = 30_000, token } = {}) {
    Object.assign(this, { url, step: seed, seed, interval_ms, patience_ms, token });
    this.latencies_ms = []; // from a change to its whole picture
    this.errors = [];
    this.reconnects = 0;
    this.generation = 0;
    this.isStopping = false;
  }

  async #connect() {
    this.client = await SpectraClient.connect(this.url, { decode: false, hello: "brief", token: this.token });
    this.generation = 0;
    this.client.socket.on("message", () => this.#look());
    await this.client.request("scene.subscribe", { channels: ["fused"] });
    await this.client.complete((await this.client.request("fusion.get")).generation, this.patience_ms);
  }

  /** Generations of a tile's colours may not go back; and nothing is kept of what was seen. */
  #look() {
    const { client } = this;
    this.newest ??= new WeakMap();
    const tiles = this.newest.get(client) ?? new Map();
    this.newest.set(client, tiles);
    for (const frame of client.frames.splice(0)) {
      if (frame.kind !== 2) continue;
      if (frame.generation < (tiles.get(frame.tile) ?? 0)) this.errors.push(`tile ${frame.tile} went back`);
      tiles.set(frame.tile, frame.generation);
    }
    if (client.notifications.length > 100) client.notifications.splice(0, client.notifications.length - 20);
    this.errors.push(...client.failures.splice(0).map(String));
  }

  async #change() {
    this.step += 7;
    const alpha = ((this.step * 617) % 9973) / 9973;
    const begin = performance.now();
    const { generation } = await this.client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha } });
    await this.client.complete(generation, this.patience_ms);
    this.latencies_ms.push(performance.now() - begin);
  }

  async #run() {
    await sleep((this.seed % 8) * (this.interval_ms / 8));
    while (!this.isStopping) {
      const next = performance.now() + this.interval_ms;
      try {
        await this.#change();
      } catch (error) {
        if (this.isStopping) break;
        this.errors.push(String(error.message ?? error));
        this.client.socket.terminate();
        this.reconnects += 1;
        while (!this.isStopping && !(await this.#connect().then(() => true, () => false))) await sleep(500);
      }
      await sleep(next - performance.now());
    }
  }

  async stop() {
    this.isStopping = true;
    this.client.socket.terminate();
    await this.ended;
  }
}
