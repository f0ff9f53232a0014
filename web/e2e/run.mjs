// End-to-end: the real server program, the built client, Debian's Chromium.
//   npm run build && npm run e2e        (SPECTRA_BIN names another server program; needs the packages of tests/integration/node too)
// SPECTRA_E2E names the tests to run by a part of their names.
import { fork } from 'node:child_process';
import { fileURLToPath } from 'node:url';

const counts = { passed: 0, failed: 0 };

/** Runs a part to its end; one that ends without its counts has failed. */
const run = (part) =>
  new Promise((resolve) => {
    let told = null;
    const child = fork(fileURLToPath(new URL('part.mjs', import.meta.url)), [part]);
    child.on('message', (message) => (told = message));
    child.on('exit', (code) => {
      if (told === null) console.log(`FAILED  the tests of "${part}" ended early, with ${code}`);
      counts.passed += told?.passed ?? 0;
      counts.failed += told?.failed ?? 1;
      resolve();
    });
  });

const start = Date.now();
// Drawing by software keeps one processor busy. What is about time has the machine to itself.
await Promise.all(['scenes', 'controls'].map(run));
await run('timed');
console.log(`\nEnd-to-end: ${counts.passed} passed, ${counts.failed} failed, ${((Date.now() - start) / 1000).toFixed(1)} s`);
process.exitCode = counts.failed === 0 ? 0 : 1;
