// Methods and palettes as a client gets them who was written from docs/protocol.md: in hello, or over HTTP.
import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { SpectraClient } from "./spectra_client.mjs";
import { run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-catalogue-"));
const scene = path.join(folder, "small.ply");
let server;
before(async () => {
  run("demo-scene", scene, "--vertices", "5000");
  server = await serve([scene]);
});
after(async () => {
  await server.stop();
  rmSync(folder, { recursive: true, force: true });
});

async function helloOf(options) {
  const client = await SpectraClient.connect(server.url, options);
  await client.close();
  assert.deepEqual(client.failures, []);
  return client.hello;
}

test("A brief hello and its catalogue say what a full hello says", async () => {
  const { session_id: _one, methods, palettes, ...full } = await helloOf();
  const { session_id: _other, catalogue, ...brief } = await helloOf({ hello: "brief" });
  assert.deepEqual(brief, full);
  const answer = await fetch(new URL(catalogue, `${server.url}/`));
  assert.equal(answer.headers.get("content-encoding"), "gzip");
  assert.match(answer.headers.get("cache-control"), /immutable/);
  assert.deepEqual(await answer.json(), { methods, palettes });
});

test("A catalogue that a client has already is not sent again, by whatever run of the server", async () => {
  const first = await fetch(`${server.url}/api/v1/catalogue`);
  const etag = first.headers.get("etag");
  assert.ok(etag.startsWith('"'), `${etag} is no strong tag`);
  await first.arrayBuffer();
  const { catalogue } = await helloOf({ hello: "brief" });
  await server.stop();
  server = await serve([scene]);
  const again = await fetch(`${server.url}/api/v1/catalogue`, { headers: { "if-none-match": etag } });
  assert.equal(again.status, 304);
  assert.equal((await again.arrayBuffer()).byteLength, 0);
  assert.equal((await helloOf({ hello: "brief" })).catalogue, catalogue);
});

test("What is not there is said", async () => {
  assert.equal((await fetch(`${server.url}/api/v1/catalogue/0123456789abcdef`)).status, 404);
  assert.equal((await fetch(`${server.url}/api/v1/catalogue`, { method: "POST" })).status, 405);
  await assert.rejects(SpectraClient.connect(server.url, { hello: "shortest" }), /400/);
});
