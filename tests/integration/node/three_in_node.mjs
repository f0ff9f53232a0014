// What three.js' Draco loader expects of a browser, so that it runs as it is published: workers from a blob's address, and
// its decoder over HTTP.
import { resolveObjectURL } from "node:buffer";
import { readFileSync } from "node:fs";
import http from "node:http";
import { createRequire } from "node:module";
import path from "node:path";
import { Worker as NodeWorker } from "node:worker_threads";

const kLikeABrowser = `
  const { parentPort } = require("node:worker_threads");
  globalThis.self = globalThis;
  globalThis.postMessage = (message, transfer) => parentPort.postMessage(message, transfer);
  parentPort.on("message", (data) => globalThis.onmessage({ data }));
`;

class BlobWorker {
  #started;
  constructor(url) {
    this.#started = resolveObjectURL(url).text().then((source) => {
      const worker = new NodeWorker(kLikeABrowser + source, { eval: true });
      worker.on("message", (data) => this.onmessage({ data }));
      return worker;
    });
  }
  postMessage(message, transfer) {
    this.#started.then((worker) => worker.postMessage(message, transfer));
  }
  terminate() {
    this.#started.then((worker) => worker.terminate());
  }
}

globalThis.self = globalThis;
globalThis.Worker = BlobWorker;
globalThis.ProgressEvent ??= class extends Event {};

/** Serves the decoder that three.js ships; resolves with its address and a way to end it. */
export async function serveDecoder() {
  const loader = createRequire(import.meta.url).resolve("three/examples/jsm/loaders/DRACOLoader.js");
  const decoders = path.join(path.dirname(loader), "../libs/draco");
  const server = http.createServer((request, response) => {
    // A connection that is kept may be closed from here just as the next request comes.
    response.setHeader("Connection", "close");
    response.end(readFileSync(path.join(decoders, path.basename(request.url))));
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { url: `http://127.0.0.1:${server.address().port}/`, stop: () => server.close() };
}
