// The samples for a reverse proxy (deploy/proxy), in the proxies themselves where they are installed: pages, roles, viewers and blocks go
// through them under the robot's name, and nobody comes in under another.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import https from "node:https";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { fileURLToPath } from "node:url";
import WebSocket from "ws";
import { patch } from "./patch.mjs";
import { run, serve } from "./spectra_server.mjs";

const NAME = "robot.example"; // of the samples
const scratch = mkdtempSync(path.join(tmpdir(), "spectra-proxy-"));
after(() => rmSync(scratch, { recursive: true, force: true }));
const at = (name) => path.join(scratch, name);
run("certificate", at("robot.pem"), at("robot.key"), "--name", NAME);
const ca = readFileSync(at("robot.pem"));
const tokens = Object.fromEntries(["viewer", "operator", "ingest"].map((role) => [role, run("token", "--file", at("tokens"), "--role", role).trim()]));
const bearer = (role) => ({ Authorization: `Bearer ${tokens[role]}` });
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** A sample with something else in the place of each of these, which have to stand in it. */
function sample(name, replacements) {
  let text = readFileSync(fileURLToPath(new URL(`../../../deploy/proxy/${name}`, import.meta.url)), "utf8");
  for (const [from, to] of replacements) {
    assert.ok(text.includes(from), `${name} has no ${from}`);
    text = text.replaceAll(from, to);
  }
  return text;
}

const PROXIES = {
  nginx(port, robot) {
    const site = sample("nginx.conf", [
      ["  listen [::]:443 ssl http2;\n", ""],
      ["listen 443", `listen 127.0.0.1:${port}`],
      ["/etc/ssl/robot.example.pem", at("robot.pem")],
      ["/etc/ssl/private/robot.example.key", at("robot.key")],
      ["http://127.0.0.1:8080", robot],
    ]);
    const kept = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"].map((kind) => `${kind}_temp_path ${at("nginx")}/${kind};`).join(" ");
    mkdirSync(at("nginx"));
    const user = process.getuid() === 0 ? "user root;" : "";
    writeFileSync(at("nginx.conf"), `${user} daemon off; pid ${at("nginx.pid")}; error_log stderr; events {} http { access_log off; ${kept}\n${site}}\n`);
    return ["nginx", ["-p", scratch, "-c", at("nginx.conf")]];
  },
  caddy(port, robot) {
    const site = sample("Caddyfile", [
      [`${NAME} {`, `${NAME}:${port} {\n\ttls ${at("robot.pem")} ${at("robot.key")}`],
      ["127.0.0.1:8080", robot.replace("http://", "")],
    ]);
    writeFileSync(at("Caddyfile"), `{\n\tadmin off\n\tauto_https disable_redirects\n}\n${site}`);
    return ["caddy", ["run", "--config", at("Caddyfile"), "--adapter", "caddyfile"]];
  },
};

async function freePort() {
  const server = net.createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  return port;
}

/** A body is sent once it is asked for, as curl does: else Caddy passes a refusal on and closes on who is still sending. */
function ask(port, target, { method = "GET", headers = {}, body } = {}) {
  return new Promise((resolve, reject) => {
    const expect = body ? { Expect: "100-continue", "Content-Length": body.length } : {};
    const options = { hostname: "127.0.0.1", port, path: target, method, servername: NAME, ca, agent: false, headers: { Host: NAME, ...headers, ...expect } };
    const request = https.request(options, (response) => {
      let text = "";
      response.on("data", (chunk) => (text += chunk));
      response.on("end", () => {
        resolve({ status: response.statusCode, text });
        request.destroy();
      });
    });
    request.on("error", reject);
    if (!body) return void request.end();
    request.once("continue", () => request.end(body));
    request.flushHeaders();
  });
}

/** The status of a refused upgrade, or what a viewer is sent: hello, and whether tiles came. */
function watch(port, origin) {
  return new Promise((resolve, reject) => {
    const headers = { Host: NAME, Origin: origin, ...bearer("viewer") };
    const socket = new WebSocket(`wss://127.0.0.1:${port}/ws`, "spectra.v1", { servername: NAME, ca, headers });
    const seen = { status: 101, frames: 0 };
    socket.on("unexpected-response", (_, response) => {
      response.resume();
      resolve({ status: response.statusCode });
    });
    socket.on("error", reject);
    socket.on("message", (data, isBinary) => {
      if (isBinary) seen.frames += 1;
      const { method, params } = isBinary ? {} : JSON.parse(data);
      if (method === "hello") {
        seen.role = params.role;
        socket.send(JSON.stringify({ jsonrpc: "2.0", id: 1, method: "scene.subscribe", params: { channels: ["fused"] } }));
      }
      if (isBinary) socket.send(JSON.stringify({ jsonrpc: "2.0", method: "stream.ack", params: { sequence: data.readUInt32LE(8) } }));
      if (method === "stream.complete") {
        socket.terminate();
        resolve(seen);
      }
    });
  });
}

for (const [name, prepare] of Object.entries(PROXIES)) {
  const isThere = spawnSync(name, [name === "nginx" ? "-v" : "version"]).status === 0;
  test(`the sample for ${name}`, { skip: !isThere && `${name} is not installed`, timeout: 60_000 }, async () => {
    const server = await serve(["--live", "--tokens", at("tokens"), "--allow-host", NAME]);
    const port = await freePort();
    const [program, args] = prepare(port, server.url);
    const proxy = spawn(program, args, { stdio: ["ignore", "ignore", "pipe"], env: { ...process.env, XDG_DATA_HOME: scratch, XDG_CONFIG_HOME: scratch } });
    let said = "";
    proxy.stderr.on("data", (chunk) => (said += chunk));
    const gone = once(proxy, "exit");
    try {
      for (let i = 0; ; i += 1) {
        const { status } = await ask(port, "/readyz").catch((error) => ({ status: String(error) }));
        if (status === 200) break;
        assert.ok(i < 100 && proxy.exitCode === null, `${status}: ${said}`);
        await sleep(100);
      }
      assert.equal((await ask(port, "/api/v1/scene")).status, 401);
      // A block that is larger than what proxies take by themselves.
      const body = patch(0, 0, { side: 301 });
      assert.ok(body.length > 1_100_000);
      assert.equal((await ask(port, "/api/v1/blocks/a", { method: "PUT", headers: bearer("viewer"), body })).status, 403);
      const put = await ask(port, "/api/v1/blocks/a", { method: "PUT", headers: bearer("ingest"), body });
      assert.equal(put.status, 200, put.text);
      assert.equal((await ask(port, "/api/v1/scene", { headers: bearer("viewer") })).status, 200);

      const seen = await watch(port, `https://${NAME}`);
      assert.equal(seen.status, 101);
      assert.equal(seen.role, "viewer");
      assert.ok(seen.frames > 0);
      assert.equal((await watch(port, "https://evil.example")).status, 403);
    } finally {
      proxy.kill("SIGTERM");
      await gone;
      await server.stop();
    }
  });
}
