// The fusion library as a WebAssembly module gives the bytes of the native one: golden vectors, random cases of the property
// tests, every method under every palette and range on extreme scenes, refusals, and temperatures as codes.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { brotliCompressSync, gzipSync } from 'node:zlib';
import { loadModule, moduleIsThere, modulePath, Placed, prepare, records } from './client_module.mjs';

const options = { skip: moduleIsThere ? false : `${modulePath} is not there: deploy/build_module.sh makes it where clang 14 and wasi-libc are` };
const cases = (...args) => records(execFileSync(process.env.SPECTRA_FUSION_CASES, args, { maxBuffer: 2 ** 31 }));

function comparePlan(module, record) {
  const plan = module.plan();
  const { range, params_in_force, highlighted } = record.plan;
  assert.deepEqual([plan.range_minimum, plan.range_maximum], range, record.name);
  assert.deepEqual(plan.params, record.settings.params, record.name);
  assert.deepEqual(plan.params_in_force, params_in_force, record.name);
  assert.deepEqual(plan.highlighted, highlighted, record.name);
}

function refusalOf(call) {
  try {
    call();
  } catch (error) {
    if (error.code === undefined || error.field === undefined) throw error;
    return { code: error.code, message: error.message, field: error.field };
  }
  return null;
}

/** Every vertex of a case, in one piece and, as rests are padded, in two. */
function compareCase(module, record) {
  const [temperature, visible, palette, fused] = record.data;
  const table = new Float64Array(palette.buffer.slice(palette.byteOffset, palette.byteOffset + palette.length));
  const refused = refusalOf(() => prepare(module, record, table));
  assert.deepEqual(refused, record.refused ?? null, record.name);
  if (refused !== null) return;
  comparePlan(module, record);
  const count = temperature.length / 4;
  const placed = new Placed(module, temperature, visible, fused.length);
  const [t, v, f] = placed.addresses;
  module.fuse(t, v, f, count);
  assert.ok(Buffer.from(module.bytes(f, fused.length)).equals(fused), record.name);
  const half = Math.floor(count / 3);
  module.bytes(f, fused.length).fill(7);
  module.fuse(t, v, f, half);
  module.fuse(t + 4 * half, v + 3 * half, f + 3 * half, count - half);
  assert.ok(Buffer.from(module.bytes(f, fused.length)).equals(fused), `${record.name}, in two parts`);
  placed.release();
}

test('golden vectors', options, async () => {
  const module = await loadModule();
  let count = 0;
  for (const record of cases('golden', fileURLToPath(new URL('../golden/fusion.json', import.meta.url)))) {
    compareCase(module, record);
    ++count;
  }
  assert.equal(count, 31);
});

test('random cases of every method', options, async () => {
  const module = await loadModule();
  let fused = 0;
  for (const record of cases('property', process.env.SPECTRA_MODULE_CASES ?? '150')) {
    compareCase(module, record);
    if (record.refused === undefined) ++fused;
  }
  assert.ok(fused > 1000, `only ${fused} cases were fused`);
});

test('every method, palette and kind of range on extreme scenes', options, async () => {
  const module = await loadModule();
  let placed = null;
  let count = 0;
  let vertices = 0;
  for (const record of cases('settings', '5003')) {
    if (record.scene !== undefined) {
      placed?.release();
      placed = new Placed(module, ...record.data, record.data[1].length);
      vertices = record.data[1].length / 3;
      continue;
    }
    prepare(module, record);
    comparePlan(module, record);
    const [temperature, visible, fused] = placed.addresses;
    module.fuse(temperature, visible, fused, vertices);
    const hash = createHash('sha256').update(module.bytes(fused, 3 * vertices)).digest();
    assert.ok(hash.equals(record.data[0]), record.name);
    ++count;
  }
  assert.ok(count > 8000, `only ${count} settings`);
});

test('what the library refuses, in its words', options, async () => {
  const module = await loadModule();
  for (const record of cases('refusals')) {
    module.resetSettings();
    const before = module.plan().params;
    assert.deepEqual(refusalOf(() => module.change(record.change)), record.refused);
    assert.deepEqual(module.plan().params, before);
  }
});

test('temperatures as 16-bit codes', options, async () => {
  const module = await loadModule();
  for (const record of cases('codes')) {
    const [codes, visible, fused] = record.data;
    prepare(module, record);
    const placed = new Placed(module, codes, visible, fused.length);
    module.fuseCodes(placed.addresses[0], record.scale, record.offset, placed.addresses[1], placed.addresses[2], codes.length / 2);
    assert.ok(Buffer.from(module.bytes(placed.addresses[2], fused.length)).equals(fused), record.name);
    placed.release();
  }
});

test('memory comes back', options, async () => {
  const module = await loadModule();
  const size = () => module.bytes(0, 0).buffer.byteLength;
  for (let i = 0; i < 20; ++i) new Placed(module, 4_000_000, 3_000_000).release();
  const before = size();
  for (let i = 0; i < 500; ++i) new Placed(module, 4_000_000, 3_000_000).release();
  assert.equal(size(), before);
});

test('the module needs nothing of its host and is at most 200 kB compressed', options, () => {
  const bytes = readFileSync(modulePath);
  assert.deepEqual(WebAssembly.Module.imports(new WebAssembly.Module(bytes)), []);
  for (const compressed of [gzipSync(bytes, { level: 9 }), brotliCompressSync(bytes)]) {
    assert.ok(compressed.length <= 200_000, `${compressed.length} bytes`);
  }
});
