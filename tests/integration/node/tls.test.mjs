// Encrypted connections: HTTPS and WSS with a certificate of one's own, what is sent in the clear, cookies, the stream of blocks, and
// another certificate while the server runs.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { copyFileSync, chmodSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import http from "node:http";
import https from "node:https";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import tls from "node:tls";
import WebSocket from "ws";
import { patch } from "./patch.mjs";
import { SpectraClient } from "./spectra_client.mjs";
import { binary, run, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-tls-"));
after(() => rmSync(scratch, { recursive: true, force: true }));
const at = (name) => path.join(scratch, name);

/** Makes one; its paths and its fingerprint. */
function certificate(name, ...more) {
  const [file, key] = [at(`${name}.pem`), at(`${name}.key`)];
  const fingerprint = run("certificate", file, key, "--name", "127.0.0.1", ...more).trim();
  return { file, key, fingerprint, pem: readFileSync(file) };
}
const own = certificate("own");
const other = certificate("other");
const encrypted = ({ file, key }) => ["--certificate", file, "--key", key];

function ask(server, { target = "/", ca = own.pem, method = "GET", headers = {}, body } = {}) {
  const { hostname, port, protocol } = new URL(server.url);
  return new Promise((resolve, reject) => {
    const request = (protocol === "https:" ? https : http).request(
      { hostname, port, path: target, method, headers, ca, agent: false },
      (response) => {
        const fingerprint = response.socket.getPeerCertificate?.().fingerprint256;
        let text = "";
        response.on("data", (chunk) => (text += chunk));
        response.on("end", () => resolve({ status: response.statusCode, headers: response.headers, text, fingerprint }));
      },
    );
    request.on("error", reject);
    request.end(body);
  });
}

/** serve() asks in the clear whether the scene is ready. */
async function serveEncrypted(...args) {
  const server = await serve([...encrypted(own), ...args], { ready: false });
  while ((await ask(server, { target: "/readyz" })).status !== 200) await new Promise((resolve) => setTimeout(resolve, 20));
  return server;
}

test("pages, viewers and blocks over TLS, and nothing in the clear", async () => {
  const server = await serveEncrypted("--live");
  assert.match(server.url, /^https:/);
  const page = await ask(server);
  assert.equal(page.status, 200);
  assert.equal(page.fingerprint, own.fingerprint);
  // Its own key is not somebody else's.
  await assert.rejects(ask(server, { ca: other.pem }), /self.signed certificate/);

  // Frames of megabytes, which OpenSSL cuts into records.
  const body = patch(0, 0, { side: 301 });
  const put = await ask(server, { method: "PUT", target: "/api/v1/blocks/large", body });
  assert.equal(put.status, 200, put.text);
  const back = await ask(server, { target: "/api/v1/blocks/large" });
  assert.equal(back.status, 200);
  const viewer = await SpectraClient.connect(server.url, { ca: own.pem });
  const complete = viewer.notification("stream.complete", 20_000);
  await viewer.request("scene.subscribe", { channels: ["fused", "temperature", "visible"] });
  await complete;
  assert.ok(viewer.tiles.size > 0);
  viewer.close();
  assert.equal(await viewer.closed, 1000);

  const file = at("pushed.ply");
  writeFileSync(file, patch(1, 0));
  const push = (...more) => spawnSync(binary, ["push", file, "--to", server.url, ...more], { encoding: "utf8" });
  const pushed = push("--ca", own.file);
  assert.equal(pushed.status, 0, pushed.stderr);
  const untrusted = push();
  assert.equal(untrusted.status, 1);
  assert.match(untrusted.stderr, /^spectra: https:\/\/\S+ is not trusted: self.signed certificate; --ca FILE names/);
  assert.match(push("--ca", file).stderr, /pushed\.ply: no certificate in PEM form can be read/);

  // In the clear: a page leads to the encrypted one, what would change something is refused.
  const clear = { url: server.url.replace("https", "http") };
  const led = await ask(clear, { target: "/login?a=b" });
  assert.equal(led.status, 308);
  assert.equal(led.headers.location, `${server.url}/login?a=b`);
  assert.equal((await ask(clear, { method: "PUT", target: "/api/v1/blocks/x", body: "ply" })).status, 403);
  assert.equal((await ask(clear, { headers: { Host: "evil.example" } })).status, 403);
  const socket = new WebSocket(`${clear.url.replace("http", "ws")}/ws`, "spectra.v1");
  const status = await new Promise((resolve) => {
    socket.on("unexpected-response", (_, response) => resolve(response.statusCode));
    socket.on("error", () => undefined);
  });
  assert.equal(status, 308);
  socket.terminate();
  assert.equal(await server.stop(), 0);
});

test("old versions, noise and whoever says nothing get nothing, and disturb nobody", async () => {
  const server = await serveEncrypted("--live");
  const { hostname, port } = new URL(server.url);
  const handshake = (options) =>
    new Promise((resolve) => {
      const socket = tls.connect({ host: hostname, port, ca: own.pem, ...options }, () => {
        resolve(socket.getProtocol());
        socket.destroy();
      });
      socket.on("error", (error) => resolve(error.code));
    });
  assert.equal(await handshake({}), "TLSv1.3");
  assert.equal(await handshake({ minVersion: "TLSv1.2", maxVersion: "TLSv1.2" }), "TLSv1.2");
  const old = await handshake({ minVersion: "TLSv1", maxVersion: "TLSv1.1", ciphers: "DEFAULT@SECLEVEL=0" });
  assert.doesNotMatch(old, /^TLSv1/);
  assert.equal(await handshake({ ALPNProtocols: ["h2", "http/1.1"] }), "TLSv1.3");

  const answer = (bytes) =>
    new Promise((resolve) => {
      const socket = net.connect(port, hostname, () => socket.write(bytes));
      let text = "";
      socket.on("data", (chunk) => (text += chunk.toString("latin1")));
      socket.on("close", () => resolve(text));
      socket.on("error", () => undefined);
    });
  // The beginning of a handshake, and then something else.
  await answer(Buffer.concat([Buffer.from([22, 3, 1, 0, 5, 1, 0, 0, 1]), Buffer.alloc(2000, 255)]));
  assert.match(await answer(Buffer.alloc(64, 1)), /^HTTP\/1.1 400/);
  const metrics = await ask(server, { target: "/metrics" });
  assert.match(metrics.text, /spectra_tls_handshakes_failed_total [1-9]/);

  // Silence, and a handshake that stops half way: as long as a request may take.
  const begin = Date.now();
  const silent = Promise.all([answer(Buffer.alloc(0)), answer(Buffer.from([22, 3, 1, 2, 0, 1, 0, 1, 252, 3, 3]))]);
  for (let i = 0; i < 20; i += 1) assert.equal((await ask(server, { target: "/healthz" })).status, 200);
  await silent;
  assert.ok(Date.now() - begin < 12_000);
  assert.equal(await server.stop(), 0);
});

test("a cookie of an encrypted connection stays there, and links lead there", async () => {
  const file = at("tokens");
  const token = run("token", "--file", file, "--role", "operator").trim();
  const server = await serveEncrypted("--live", "--tokens", file, "--invite", "viewer");
  assert.match(server.output(), /for one viewer, within 15 minutes: https:\/\//);
  const login = await ask(server, { method: "POST", target: "/api/v1/session", body: JSON.stringify({ token }) });
  assert.equal(login.status, 200, login.text);
  assert.match(login.headers["set-cookie"][0], /; HttpOnly; SameSite=Strict; .*; Secure$/);
  assert.equal(await server.stop(), 0);
});

test("another certificate is taken on SIGHUP, one that does not fit is not, and nobody is cut", async () => {
  for (const name of ["pem", "key"]) copyFileSync(at(`own.${name}`), at(`shown.${name}`));
  const shown = { file: at("shown.pem"), key: at("shown.key") };
  const server = await serve([...encrypted(shown), "--live"], { ready: false });
  const viewer = new WebSocket(`${server.url.replace("http", "ws")}/ws`, "spectra.v1", { ca: own.pem });
  await new Promise((resolve) => viewer.once("message", resolve));
  const hangUp = async (words) => {
    const before = server.errors().length;
    server.process.kill("SIGHUP");
    while (!words.test(server.errors().slice(before))) await new Promise((resolve) => setTimeout(resolve, 20));
  };
  copyFileSync(other.file, shown.file);
  await hangUp(/the certificate stays as it was: .*shown\.key: is not the key of .*shown\.pem/);
  assert.equal((await ask(server)).fingerprint, own.fingerprint);
  copyFileSync(other.key, shown.key);
  await hangUp(/the certificate is read again/);
  assert.equal((await ask(server, { ca: other.pem })).fingerprint, other.fingerprint);
  assert.equal(viewer.readyState, WebSocket.OPEN);
  viewer.terminate();
  assert.equal(await server.stop(), 0);
});

test("what is wrong with a certificate is said before anything is served", () => {
  const start = (...args) => spawnSync(binary, ["serve", "--live", "--listen", "127.0.0.1:0", ...args], { encoding: "utf8", timeout: 10_000 });
  writeFileSync(at("empty"), "");
  const open = at("open.key");
  copyFileSync(own.key, open);
  chmodSync(open, 0o644);
  for (const [args, words, status] of [
    [["--certificate", own.file], /--key/, 2],
    [["--key", own.key], /--certificate/, 2],
    [encrypted({ file: at("none"), key: own.key }), /none: cannot be opened/, 1],
    [encrypted({ file: at("empty"), key: own.key }), /empty: is no certificate in PEM form/, 1],
    [encrypted({ file: own.file, key: own.file }), /own\.pem: is no private key in PEM form/, 1],
    [encrypted({ file: own.file, key: other.key }), /other\.key: is not the key of .*own\.pem/, 1],
    [encrypted({ file: own.file, key: open }), /open\.key: everybody on this machine can read this key/, 1],
  ]) {
    const ended = start(...args);
    assert.equal(ended.status, status, `${args}: ${ended.stderr}`);
    assert.match(ended.stderr, words);
    assert.equal(ended.stdout, "");
  }
});

test("spectra certificate keeps keys to itself and what is there", () => {
  assert.equal(statSync(own.key).mode & 0o077, 0);
  const again = spawnSync(binary, ["certificate", own.file, own.key], { encoding: "utf8" });
  assert.equal(again.status, 1);
  assert.match(again.stderr, /own\.pem is there already; --replace writes over it/);
  assert.deepEqual(readFileSync(own.file), own.pem);
  const wrong = spawnSync(binary, ["certificate", at("a.pem"), at("a.key"), "--name", "no name"], { encoding: "utf8" });
  assert.equal(wrong.status, 2);
  assert.match(wrong.stderr, /--name: no name is neither a host name nor an IP address/);
  // By default for all that this machine is called.
  const said = spawnSync(binary, ["certificate", at("b.pem"), at("b.key"), "--days", "7"], { encoding: "utf8" });
  assert.match(said.stderr, /good until \d{4}-\d\d-\d\d for .*localhost.*127\.0\.0\.1/);
});
