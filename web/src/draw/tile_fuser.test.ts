import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';
import type { FusionChange } from '../protocol/messages';
import { TileFuser } from './tile_fuser';

const MODULE = fileURLToPath(new URL('../../../build/wasm/bin/fusion.wasm', import.meta.url));

describe.skipIf(!existsSync(MODULE))('TileFuser', () => {
  const raw = { codes: Uint16Array.of(0, 500, 1000), scale: 0.01, offset: 20, rgb: new Uint8Array(9) };
  const summary = { finite_count: 3, missing_count: 0, over_range_count: 0, under_range_count: 0, minimum: 20, maximum: 30 };
  const facts = (mean: number) => ({ summary: { ...summary, mean, sigma: 4 }, histograms: [], hues: null });
  const settings: FusionChange = { method: 'thermal_only', range: { mode: 'auto' } };

  it('goes on in the settings that are set when other facts come, until they are set anew', async () => {
    const fuser = new TileFuser(await WebAssembly.compile(readFileSync(MODULE)));
    const fused = () => {
      const rgba = new Uint8Array(12);
      fuser.fuse(raw, rgba, false);
      return [...rgba];
    };
    expect(fused).toThrow('no settings');
    fuser.setFacts(facts(25));
    fuser.setSettings(settings);
    const before = fused();
    fuser.setFacts({ ...facts(25), summary: { ...facts(25).summary, maximum: 60 } });
    expect(fused()).toEqual(before);
    fuser.setSettings(settings);
    expect(fused()).not.toEqual(before);
  });
});
