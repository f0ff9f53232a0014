// Starts the built program for a test and stops it afterwards.
import { spawn, spawnSync } from "node:child_process";
import { existsSync } from "node:fs";
import { after } from "node:test";
import { fileURLToPath } from "node:url";

export const binary =
  process.env.SPECTRA_BIN ?? fileURLToPath(new URL("../../../build/release/bin/spectra", import.meta.url));
if (!existsSync(binary)) throw new Error(`${binary} is not built; set SPECTRA_BIN`);

// A test that fails before it stops its server neither waits for it nor leaves it behind.
const running = new Set();
if (process.env.NODE_TEST_CONTEXT) after(() => running.forEach((server) => server.kill("SIGKILL")));

/** Runs a command of the program to its end. */
export function run(...args) {
  const { status, stdout, stderr } = spawnSync(binary, args, { encoding: "utf8", maxBuffer: 1 << 28 });
  if (status !== 0) throw new Error(`spectra ${args.join(" ")}: exit ${status}: ${stderr}`);
  return stdout;
}

/** Serves; resolves with {url, process, stop} once `listening on` is printed and the scene is ready. */
export async function serve(args, { ready = true } = {}) {
  const place = args.includes("--listen") ? [] : ["--listen", "127.0.0.1:0"];
  const process_ = spawn(binary, ["serve", ...place, ...args], { stdio: ["ignore", "pipe", "pipe"] });
  let output = "";
  let errors = "";
  process_.stderr.on("data", (chunk) => {
    errors += chunk;
  });
  const exited = new Promise((resolve) => process_.once("exit", resolve));
  const url = await new Promise((resolve, reject) => {
    process_.stdout.on("data", (chunk) => {
      output += chunk;
      const match = /listening on (https?:\/\/[^\s/]+)/.exec(output);
      if (match) resolve(match[1]);
    });
    exited.then((code) => reject(new Error(`spectra serve: exit ${code}: ${errors}`)));
  });
  running.add(process_);
  exited.then(() => running.delete(process_));
  const stop = async () => {
    process_.kill("SIGTERM");
    return exited;
  };
  if (ready) {
    const deadline = Date.now() + 120_000;
    while ((await fetch(`${url}/readyz`)).status !== 200) {
      if (Date.now() > deadline) throw new Error("the scene is not ready after 120 s");
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
  }
  return { url, process: process_, stop, errors: () => errors, output: () => output };
}
