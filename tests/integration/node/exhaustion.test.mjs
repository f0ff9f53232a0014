// Memory runs out while viewers come: it costs connections, and never the server.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import http from "node:http";
import net from "node:net";
import { test } from "node:test";
import { patch } from "./patch.mjs";
import { rawFrame } from "./raw_websocket.mjs";
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
  /** Over a connection of its own, which ends with the answer. */
  const ask = (path, { method = "GET", body } = {}) =>
    new Promise((resolve, reject) => {
      const request = http.request(`${server.url}${path}`, { method, agent: false, timeout: 10_000 }, (response) => {
        let text = "";
        response.on("data", (chunk) => (text += chunk));
        response.on("end", () => resolve({ status: response.statusCode, text }));
      });
      request.on("timeout", () => request.destroy(new Error(`${path} is not answered`)));
      request.on("error", reject);
      request.end(body);
    });
  assert.equal((await ask("/api/v1/blocks/a", { method: "PUT", body: patch(0, 0) })).status, 200);
  const upgrade = [
    "GET /ws HTTP/1.1",
    `Host: ${host}`,
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Protocol: spectra.v1",
  ];
  const subscribe = rawFrame(0x81, Buffer.from('{"jsonrpc":"2.0","id":1,"method":"scene.subscribe","params":{"channels":["fused"]}}'));
  /** Waits until the gauges, of all roles together, are these. */
  const count = async (expected) => {
    let seen;
    for (let i = 0; i < 400; i += 1) {
      const { text } = await ask("/metrics");
      const sum = (name) => {
        const found = [...text.matchAll(new RegExp(`^${name}(?:{.*})? (\\S+)$`, "gm"))];
        assert.ok(found.length > 0, `no ${name}`);
        return found.reduce((all, [, value]) => all + Number(value), 0);
      };
      seen = Object.fromEntries(Object.keys(expected).map((name) => [name, sum(name)]));
      if (JSON.stringify(seen) === JSON.stringify(expected)) return;
      await sleep(50);
    }
    assert.deepEqual(seen, expected);
  };
  const ended = () => server.process.exitCode ?? server.process.signalCode;
  let lost = 0;
  let subscribed = 0;
  for (const spare_bytes of [0, 1 << 20, 2 << 20, 3 << 20, 1 << 19, 0, 1 << 20, 2 << 20]) {
    limit(addressSpace() + spare_bytes);
    const sockets = [];
    for (let i = 0; i < 500; i += 1) {
      const socket = net.connect({ host: hostname, port });
      socket.on("error", () => {});
      socket.on("close", () => (lost += 1));
      socket.once("data", () => {
        subscribed += 1;
        socket.write(subscribe);
      });
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
    assert.equal((await ask("/readyz")).status, 200);
    await count({ spectra_viewers: 0, spectra_role_viewers: 0, spectra_role_queued_bytes: 0 });
  }
  await count({ spectra_connections: 1 });
  assert.ok(subscribed > 100, `${subscribed} viewers subscribed`);
  assert.ok(lost > 0, "memory never ran out");
  assert.match(server.errors(), /bad_alloc|no memory/);
  const viewer = await SpectraClient.connect(server.url);
  await viewer.request("scene.subscribe", { channels: ["fused"] });
  await viewer.complete((await viewer.request("fusion.get")).generation);
  assert.equal((await viewer.notification("stream.stats")).viewers, 1);
  assert.deepEqual(viewer.failures, []);
  viewer.socket.terminate();
  assert.equal(await server.stop(), 0);
});
