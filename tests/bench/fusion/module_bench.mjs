// Nanoseconds a vertex of every method in the WebAssembly module under Node, beside the native library as the server uses it on
// this machine, in one run on one core. Colours are compared before anything is timed.
//
//   node module_bench.mjs [VERTICES]        SPECTRA_FUSION_CASES: the built fusion_cases (default build/release/bin)
//
// The status is 1 when a byte differs.
import { execFileSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';
import { loadModule, Placed, prepare, records } from '../../module/client_module.mjs';

const vertices = Number(process.argv[2] ?? 1_000_000);
const program = process.env.SPECTRA_FUSION_CASES ?? fileURLToPath(new URL('../../../build/release/bin/fusion_cases', import.meta.url));
const rounds = Math.max(7, Math.round(40_000_000 / vertices));
const measured = () => [...records(execFileSync(program, ['bench', vertices, rounds], { maxBuffer: 2 ** 31 - 1 }))];

const module = await loadModule();
// Natively before and after, so that whatever else the machine does meets both.
const [scene, ...before] = measured();
const placed = new Placed(module, ...scene.data, scene.data[1].length);
const [temperature, visible, fused] = placed.addresses;
const best = new Map();
let equal = true;
for (let half = 0; half < 2; ++half) {
  for (const record of before) {
    prepare(module, record);
    let least = best.get(record.name) ?? Infinity;
    for (let round = 0; round < rounds; ++round) {
      const begin = performance.now();
      module.fuse(temperature, visible, fused, vertices);
      least = Math.min(least, performance.now() - begin);
    }
    best.set(record.name, least);
    if (!Buffer.from(module.bytes(fused, 3 * vertices)).equals(record.data[0])) {
      console.log(`${record.name}: the bytes differ`);
      equal = false;
    }
  }
}
const [, ...after] = measured();
console.log(`${vertices} vertices            native   module  ratio`);
let worst = 0;
before.forEach((record, i) => {
  const native = Math.min(record.nanoseconds, after[i].nanoseconds);
  const own = (best.get(record.name) * 1e6) / vertices;
  worst = Math.max(worst, own / native);
  console.log(`${record.name.padEnd(26)} ${native.toFixed(2).padStart(7)}  ${own.toFixed(2).padStart(7)}  ${(own / native).toFixed(1).padStart(5)}`);
});
console.log(`worst ratio ${worst.toFixed(1)}`);
process.exit(equal ? 0 : 1);
