// The web client's own wrapper around the WebAssembly module, and the module that deploy/build_module.sh made.
import { readFileSync, existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
export const modulePath = process.env.SPECTRA_FUSION_MODULE ?? `${root}build/wasm/bin/fusion.wasm`;

/** False where there is no compiler for it; deploy/build_module.sh says so. */
export const moduleIsThere = existsSync(modulePath);

export async function loadModule() {
  const { build } = createRequire(`${root}web/package.json`)('esbuild');
  const bundled = await build({
    entryPoints: [`${root}web/src/fusion/fusion_module.ts`],
    bundle: true,
    format: 'esm',
    write: false,
  });
  const { FusionModule } = await import(`data:text/javascript;base64,${Buffer.from(bundled.outputFiles[0].contents).toString('base64')}`);
  return FusionModule.from(readFileSync(modulePath));
}

/** The records of fusion_cases, one after the other: the JSON with `data`, its arrays as Buffers. */
export function* records(bytes) {
  let at = 0;
  const take = (length) => bytes.subarray(at, (at += length));
  while (at < bytes.length) {
    const record = JSON.parse(take(take(4).readUInt32LE()).toString());
    record.data = record.arrays.map((length) => Buffer.from(take(length)));
    yield record;
  }
}

/** Arrays in the module's memory. */
export class Placed {
  constructor(module, ...arrays) {
    this.module = module;
    this.addresses = arrays.map((array) => module.allocate(typeof array === 'number' ? array : array.length));
    arrays.forEach((array, i) => {
      if (typeof array !== 'number') module.bytes(this.addresses[i], array.length).set(array);
    });
  }
  release() {
    for (const address of this.addresses) this.module.release(address);
  }
}

/** Gives the module settings and the facts that a plan asks for, as the client does. */
export function prepare(module, record, palette) {
  module.resetSettings();
  module.change(record.settings);
  module.setScene(record.facts.summary);
  for (let rounds = 0; rounds < 8; ++rounds) {
    const wanted = module.prepare(palette);
    if (wanted === null) return;
    if (wanted.bins !== null) module.setHistogram(record.facts.histograms[wanted.bins]);
    if (wanted.hues) module.setHues(record.facts.hues);
  }
  throw new Error('the module asks for facts without end');
}
