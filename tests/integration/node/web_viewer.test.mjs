// The viewer that tests/soak measures cuts with comes back as the web client does: it has all it had, through any number of cuts.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { WebViewer } from "../../soak/web_viewer.mjs";
import { linkProxy } from "./link_proxy.mjs";
import { patch } from "./patch.mjs";
import { serve } from "./spectra_server.mjs";

let server;
let proxy;
before(async () => {
  server = await serve(["--live"]);
  const reply = await fetch(`${server.url}/api/v1/blocks/b`, { method: "PUT", body: patch(0, 0, { side: 61 }) });
  assert.equal(reply.status, 200, await reply.text());
  proxy = await linkProxy(server.url);
});
after(async () => {
  await proxy.close();
  await server.stop();
});

test("after a cut nothing comes that it has, and of another setting colours alone", { timeout: 60_000 }, async (t) => {
  const viewer = new WebViewer(proxy.url);
  t.after(() => viewer.stop());
  await viewer.show(0.3);
  const all = viewer.frames;
  for (let cut = 0; cut < 2; cut += 1) {
    proxy.cut();
    await viewer.show(0.3);
    assert.equal(viewer.frames, all);
  }
  proxy.cut();
  await viewer.show(0.7);
  const colours = viewer.frames - all;
  assert.ok(colours > 0 && colours <= all / 2, `${colours} of ${all} frames`);
  proxy.cut();
  await viewer.show(0.7);
  assert.equal(viewer.frames, all + colours);
});
