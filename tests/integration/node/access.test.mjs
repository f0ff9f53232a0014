// Who may do what: every role at every path and with every message, cookies, codes, other origins, tokens that are taken back. What is
// refused has no effect.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { appendFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import http from "node:http";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import WebSocket from "ws";
import { patch } from "./patch.mjs";
import { binary, run, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-access-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

const ROLES = ["viewer", "operator", "ingest", "admin"];
const file = path.join(scratch, "tokens");
const tokens = Object.fromEntries(ROLES.map((role) => [role, run("token", "--file", file, "--role", role).trim()]));
const bearer = (token) => (token === undefined ? {} : { Authorization: `Bearer ${token}` });

/** fetch() may not set Host and Origin. */
function ask(server, method, target, { headers = {}, body } = {}) {
  const { hostname, port } = new URL(server.url);
  return new Promise((resolve, reject) => {
    const request = http.request({ hostname, port, path: target, method, headers, agent: false }, (response) => {
      let text = "";
      response.on("data", (chunk) => (text += chunk));
      response.on("end", () => resolve({ status: response.statusCode, headers: response.headers, text }));
    });
    request.on("error", reject);
    request.end(body);
  });
}

/** How an upgrade ends: the status of a refusal, or the open socket with the first text that came. */
function upgrade(server, target, protocol, headers = {}) {
  return new Promise((resolve, reject) => {
    const socket = new WebSocket(server.url.replace("http", "ws") + target, protocol, { headers });
    socket.on("unexpected-response", (_, response) => {
      response.resume();
      resolve({ status: response.statusCode });
    });
    socket.on("message", (data) => resolve({ status: 101, socket, hello: JSON.parse(data).params }));
    socket.on("error", reject);
  });
}

const serveWithTokens = (...more) => serve(["--live", "--tokens", file, ...more]);
const blocks = async (server) => JSON.parse((await ask(server, "GET", "/api/v1/blocks", { headers: bearer(tokens.admin) })).text).blocks;

test("every role at every path", async () => {
  const server = await serveWithTokens();
  const body = patch(0, 0, { side: 5 });
  const put = await ask(server, "PUT", "/api/v1/blocks/known", { headers: bearer(tokens.ingest), body });
  assert.equal(put.status, 200, put.text);
  // By nobody, viewer, operator, ingest, admin, and somebody with a wrong token.
  const matrix = [
    ["GET", "/", [303, 200, 200, 303, 200, 303]],
    ["GET", "/healthz", [200, 200, 200, 200, 200, 200]],
    ["GET", "/api/v1/session", [200, 200, 200, 200, 200, 200]],
    ["GET", "/api/v1/scene", [401, 200, 200, 403, 200, 401]],
    ["GET", "/api/v1/catalogue", [401, 200, 200, 403, 200, 401]],
    ["GET", "/api/v1/scene.ply", [401, 403, 200, 403, 200, 401]],
    ["GET", "/api/v1/scene.glb", [401, 403, 200, 403, 200, 401]],
    ["GET", "/metrics", [401, 403, 200, 403, 200, 401]],
    ["GET", "/api/v1/blocks", [401, 403, 200, 200, 200, 401]],
    ["GET", "/api/v1/blocks/known", [401, 403, 200, 200, 200, 401]],
    ["HEAD", "/api/v1/scene.ply", [401, 403, 200, 403, 200, 401]],
    ["GET", "/api/v1/nothing", [401, 404, 404, 403, 404, 401]],
    ["PUT", "/api/v1/blocks/new", [401, 403, 403, 200, 200, 401]],
    ["DELETE", "/api/v1/blocks/new", [401, 403, 403, 200, 200, 401]],
    ["POST", "/api/v1/session/codes", [401, 403, 200, 403, 200, 401]],
  ];
  const somebody = [undefined, ...ROLES.map((role) => tokens[role]), "wrong"];
  for (const [method, target, statuses] of matrix) {
    for (const [i, token] of somebody.entries()) {
      // Wrong ones are limited: a viewer's good name helps nobody.
      if (token === "wrong" && !["GET /", "GET /api/v1/scene", "PUT /api/v1/blocks/new"].includes(`${method} ${target}`)) continue;
      const before = method === "PUT" ? (await blocks(server)).length : 0;
      const sent = method === "PUT" ? body : method === "POST" ? JSON.stringify({ role: "viewer" }) : undefined;
      if (method === "DELETE" && statuses[i] === 200) {
        await ask(server, "PUT", target, { headers: bearer(tokens.admin), body });
      }
      const { status, headers, text } = await ask(server, method, target, { headers: bearer(token), body: sent });
      const who = `${method} ${target} by ${[undefined, ...ROLES, "wrong"][i]}`;
      assert.equal(status, statuses[i], `${who}: ${text}`);
      if (status === 401) assert.equal(headers["www-authenticate"], "Bearer", who);
      if (status === 303) assert.equal(headers.location, "/login");
      if (status >= 401 && method !== "HEAD" && status !== 404) assert.ok(JSON.parse(text).error.reason.length > 10, who);
      if (method === "PUT") {
        assert.equal((await blocks(server)).length - before, status === 200 ? 1 : 0, who);
        await ask(server, "DELETE", target, { headers: bearer(tokens.admin) });
      }
    }
  }
  assert.deepEqual((await blocks(server)).map(({ id }) => id), ["known"]);
  await server.stop();
  for (const token of Object.values(tokens)) assert.ok(!server.errors().includes(token), "no token in the log");
});

test("every role at the two upgrades, and what a viewer is told", async () => {
  const server = await serveWithTokens();
  const expected = { viewer: [101, 403], operator: [101, 403], ingest: [403, 101], admin: [101, 101] };
  assert.equal((await upgrade(server, "/ws", "spectra.v1")).status, 401);
  assert.equal((await upgrade(server, "/ingest", "spectra.ingest.v1")).status, 401);
  for (const role of ROLES) {
    const watching = await upgrade(server, "/ws", "spectra.v1", bearer(tokens[role]));
    assert.equal(watching.status, expected[role][0], role);
    if (watching.socket) {
      assert.equal(watching.hello.role, role === "viewer" ? "viewer" : "operator");
      watching.socket.terminate();
    }
    const sending = await upgrade(server, "/ingest", "spectra.ingest.v1", bearer(tokens[role]));
    assert.equal(sending.status, expected[role][1], role);
    sending.socket?.terminate();
  }
  await server.stop();
});

test("a browser logs in, is known by its cookie, only from pages of the robot, and logs out", async () => {
  const server = await serveWithTokens();
  const login = (text, headers = {}) => ask(server, "POST", "/api/v1/session", { headers, body: JSON.stringify({ token: text }) });
  for (const bad of ["", "{", "[]", '{"token":5}', '{"token":"a","more":1}', '{"key":"a"}', "[".repeat(900)]) {
    assert.equal((await ask(server, "POST", "/api/v1/session", { body: bad })).status, 400, bad);
  }
  assert.equal((await ask(server, "POST", "/api/v1/session", { body: JSON.stringify({ token: "x".repeat(2000) }) })).status, 413);
  assert.equal((await login("wrong")).status, 401);
  assert.equal((await login(tokens.operator, { Origin: "http://evil.example" })).status, 403);
  const good = await login(tokens.operator, { Origin: server.url });
  assert.equal(good.status, 200);
  assert.match(good.headers["set-cookie"][0], /; HttpOnly; SameSite=Strict;/);
  const Cookie = good.headers["set-cookie"][0].split(";")[0];
  assert.deepEqual(JSON.parse((await ask(server, "GET", "/api/v1/session", { headers: { Cookie } })).text), { needs_token: true, role: "operator" });
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: { Cookie } })).status, 200);

  const opened = await upgrade(server, "/ws", "spectra.v1", { Cookie, Origin: server.url });
  assert.equal(opened.status, 101);
  opened.socket.terminate();
  assert.equal((await upgrade(server, "/ws", "spectra.v1", { Cookie, Origin: "http://evil.example" })).status, 403);
  assert.equal((await upgrade(server, "/ws", "spectra.v1", { Cookie })).status, 403, "a browser always says where a page is from");
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: { Cookie, Host: "evil.example" } })).status, 403);
  assert.equal((await ask(server, "DELETE", "/api/v1/session", { headers: { Cookie, Origin: "http://evil.example" } })).status, 403);

  const out = await ask(server, "DELETE", "/api/v1/session", { headers: { Cookie, Origin: server.url } });
  assert.match(out.headers["set-cookie"][0], /=; .*Max-Age=0/);
  for (const method of ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"]) {
    assert.equal((await ask(server, method, "/api/v1/scene", { headers: { Cookie } })).status, 405, method);
  }
  await server.stop();
});

test("a code lets one browser in, once", async () => {
  const server = await serveWithTokens();
  const codes = (token, role) => ask(server, "POST", "/api/v1/session/codes", { headers: bearer(token), body: JSON.stringify({ role }) });
  assert.equal((await codes(tokens.operator, "operator")).status, 403);
  assert.equal((await codes(tokens.admin, "pilot")).status, 400);
  const made = JSON.parse((await codes(tokens.operator, "viewer")).text);
  assert.equal(made.path, `/login#${made.code}`);
  const use = () => ask(server, "POST", "/api/v1/session", { body: JSON.stringify({ token: made.code }) });
  const first = await use();
  assert.deepEqual([first.status, JSON.parse(first.text).role], [200, "viewer"]);
  assert.equal((await use()).status, 401);
  await server.stop();

  const inviting = await serveWithTokens("--invite", "viewer");
  const link = /within 15 minutes: (\S+)/.exec(inviting.output())[1];
  assert.equal(link.replace(/#.*/, ""), `${inviting.url}/login`);
  const login = await ask(inviting, "POST", "/api/v1/session", { body: JSON.stringify({ token: link.split("#")[1] }) });
  assert.deepEqual(JSON.parse(login.text), { role: "viewer" });
  await inviting.stop();
});

test("wrong tokens are limited by address, and good ones are not", async () => {
  const server = await serveWithTokens();
  const statuses = [];
  for (let i = 0; i < 20; i += 1) statuses.push((await ask(server, "GET", "/api/v1/scene", { headers: bearer(`wrong ${i}`) })).status);
  assert.deepEqual(statuses.slice(0, 8), Array(8).fill(401));
  assert.ok(statuses.filter((status) => status === 429).length >= 10, `${statuses}`);
  assert.equal((await ask(server, "POST", "/api/v1/session", { body: JSON.stringify({ token: tokens.viewer }) })).status, 429);
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: bearer(tokens.viewer) })).status, 200);
  await server.stop();
});

test("a token that is taken back ends what was begun with it", async () => {
  const own = path.join(scratch, "changing");
  const kept = run("token", "--file", own, "--role", "admin").trim();
  const lent = run("token", "--file", own, "--role", "viewer", "--name", "guest").trim();
  const server = await serve(["--live", "--tokens", own]);
  const { socket } = await upgrade(server, "/ws", "spectra.v1", bearer(lent));
  const closed = new Promise((resolve) => socket.on("close", (code, reason) => resolve([code, `${reason}`])));
  const login = await ask(server, "POST", "/api/v1/session", { body: JSON.stringify({ token: lent }) });
  const Cookie = login.headers["set-cookie"][0].split(";")[0];
  // A file that is wrong changes nothing.
  const good = readFileSync(own);
  appendFileSync(own, "nonsense\n");
  server.process.kill("SIGHUP");
  const said = async (text) => {
    for (let i = 0; i < 200 && !server.errors().includes(text); i += 1) await new Promise((resolve) => setTimeout(resolve, 20));
    assert.ok(server.errors().includes(text), server.errors());
  };
  await said("stay as they were");
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: bearer(lent) })).status, 200);
  writeFileSync(own, good);
  run("token", "--file", own, "--remove", "guest");
  server.process.kill("SIGHUP");
  await said("are read again");
  assert.deepEqual(await closed, [4003, "access was withdrawn"]);
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: bearer(lent) })).status, 401);
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: { Cookie } })).status, 401);
  assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: bearer(kept) })).status, 200);
  await server.stop();
});

test("a server for a network wants tokens, or to be told that it wants none", async () => {
  const wrong = (...args) => {
    const { status, stderr } = spawnSync(binary, ["serve", "--live", ...args], { encoding: "utf8", timeout: 20_000 });
    return [status, stderr.trim().split("\n").length, stderr];
  };
  const [status, lines, text] = wrong("--listen", "0.0.0.0:0");
  assert.deepEqual([status, lines], [2, 1]);
  assert.match(text, /--tokens.*--insecure/);
  assert.equal(wrong("--listen", "127.0.0.1:0", "--invite", "viewer")[0], 2);
  assert.equal(wrong("--listen", "127.0.0.1:0", "--tokens", path.join(scratch, "none"))[0], 1);
  assert.equal(wrong("--listen", "127.0.0.1:0", "--tokens", file, "--insecure")[0], 2);
  const open = await serve(["--live", "--insecure", "--listen", "0.0.0.0:0"]);
  assert.equal((await ask(open, "GET", "/api/v1/scene")).status, 200);
  assert.match(open.errors(), /anybody/);
  await open.stop();
  process.env.SPECTRA_TOKENS = "operator=0123456789abcdef01234567";
  try {
    const server = await serve(["--live"]);
    assert.equal((await ask(server, "GET", "/api/v1/scene")).status, 401);
    assert.equal((await ask(server, "GET", "/api/v1/scene", { headers: bearer("0123456789abcdef01234567") })).status, 200);
    await server.stop();
    process.env.SPECTRA_TOKENS = "operator=short";
    assert.match(wrong("--listen", "127.0.0.1:0")[2], /SPECTRA_TOKENS: .*shorter/);
  } finally {
    delete process.env.SPECTRA_TOKENS;
  }
});

test("push shows its token", async () => {
  const server = await serveWithTokens();
  const ply = path.join(scratch, "part.ply");
  writeFileSync(ply, patch(0, 0, { side: 5 }));
  const push = (env, ...more) =>
    spawnSync(binary, ["push", ply, "--to", server.url, ...more], { encoding: "utf8", env: { ...process.env, ...env }, timeout: 60_000 });
  const refused = push({});
  assert.equal(refused.status, 1);
  assert.match(refused.stderr, /401 .*token/);
  assert.equal(push({ SPECTRA_TOKEN: tokens.viewer }).status, 1);
  assert.equal(push({ SPECTRA_TOKEN: tokens.ingest }).status, 0);
  const secret = path.join(scratch, "ingest token");
  writeFileSync(secret, `${tokens.ingest}\n`);
  assert.equal(push({}, "--token-file", secret).status, 0);
  assert.equal(push({}, "--token-file", path.join(scratch, "none")).status, 1);
  assert.equal((await blocks(server)).length, 1);
  await server.stop();
});
