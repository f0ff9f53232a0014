// Memory runs out while viewers come: it costs connections, and never the server.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import net from "node:net";
import { test } from "node:test";
import { patch } from "./patch.mjs";
import { SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const LARGEST_ADDRESS_SPACE = 1e12; // Sanitizers take all of it, and cannot be without memory.

test("without memory connections are refused or lost, and with it again everything goes on", { timeout: 120_000 }, async (t) => {
  const server = await serve(["--live"]);
  const { hostname, port, host } = new URL(server.url);
  const addressSpace = () => 1024 * Number(/VmSize:\s+(\d+)/.exec(readFileSync(`/proc/${server.process.pid}/status`, "utf8"))[1]);
  if (addressSpace() > LARGEST_ADDRESS_SPACE) {
    t.skip("built with a sanitizer");
    await server.stop();
    return;
  }
  const limit = (bytes) => assert.equal(spawnSync("prlimit", ["--pid", `${server.process.pid}`, `--as=${bytes}:`]).status, 0);
  assert.equal((await fetch(`${server.url}/api/v1/blocks/a`, { method: "PUT", body: patch(0, 0) })).status, 200);
  const upgrade = [
    "GET /ws HTTP/1.1",
    `Host: ${host}`,
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Protocol: spectra.v1",
  ];
  const ended = () => server.process.exitCode ?? server.process.signalCode;
  let lost = 0;
  for (const spare_bytes of [0, 1 << 20, 2 << 20, 3 << 20, 1 << 19, 0, 1 << 20, 2 << 20]) {
    limit(addressSpace() + spare_bytes);
    const sockets = [];
    for (let i = 0; i < 500; i += 1) {
      const socket = net.connect({ host: hostname, port });
      socket.on("error", () => {});
      socket.on("close", () => (lost += 1));
      socket.on("data", () => {});
      socket.write(`${upgrade.join("\r\n")}\r\n\r\n`);
      sockets.push(socket);
      if (i % 25 === 24) await sleep(5);
    }
    await sleep(300);
    assert.equal(ended(), null, server.errors().slice(-500));
    limit("unlimited");
    for (const socket of sockets) {
      socket.removeAllListeners("close");
      socket.destroy();
    }
    await sleep(50);
    assert.equal((await fetch(`${server.url}/readyz`, { signal: AbortSignal.timeout(10_000) })).status, 200);
  }
  assert.ok(lost > 0, "memory never ran out");
  assert.match(server.errors(), /bad_alloc|no memory/);
  const viewer = await SpectraClient.connect(server.url);
  await viewer.request("scene.subscribe", { channels: ["fused"] });
  await viewer.complete((await viewer.request("fusion.get")).generation);
  assert.deepEqual(viewer.failures, []);
  viewer.socket.terminate();
  assert.equal(await server.stop(), 0);
});
