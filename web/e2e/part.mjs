// A part of the end-to-end tests, in a process and a browser of its own: node e2e/part.mjs NAME, which run.mjs does.
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { addAccessTests } from './access.mjs';
import { addAccuracyTests } from './accuracy.mjs';
import { addAxeTests } from './axe.mjs';
import { addDemoTests } from './demo.mjs';
import { addFusingTests } from './fusing.mjs';
import { runTests, startBrowser } from './harness.mjs';
import { addKeptTests } from './kept.mjs';
import { addLayoutTests } from './layout.mjs';
import { addLetteringTests } from './lettering.mjs';
import { addLinkTests } from './links.mjs';
import { addLiveTests } from './live.mjs';
import { addLoadTests } from './load.mjs';
import { addViewTests } from './view.mjs';

const PARTS = {
  scenes: [addDemoTests, addAccuracyTests, addAxeTests, addLetteringTests, addLiveTests, addViewTests],
  controls: [addFusingTests, addKeptTests, addLayoutTests, addAccessTests],
  timed: [addLinkTests, addLoadTests],
};

const scratch = mkdtempSync(join(tmpdir(), 'spectra-e2e-'));
const browser = await startBrowser();
const ends = [];
for (const add of PARTS[process.argv[2]]) ends.push(await add(browser, scratch));
const counts = await runTests();
for (const end of ends) await end?.();
await browser.close();
rmSync(scratch, { recursive: true, force: true });
// What a failed test has left open must not keep this process waiting.
process.send(counts, () => process.exit());
