import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { cacheBytes } from './cache_bytes';

const schema = JSON.parse(readFileSync(new URL('../../../protocol/schema/stream.schema.json', import.meta.url), 'utf8')) as {
  $defs: { SubscribeRequest: { properties: { cache_bytes: { minimum: number; maximum: number } } } };
};

describe('cacheBytes', () => {
  it('is a sixteenth of the memory, and a quarter of a GiB where nobody tells', () => {
    expect(cacheBytes(8)).toBe(512 * 2 ** 20);
    expect(cacheBytes(0.25)).toBe(16 * 2 ** 20);
    expect(cacheBytes(undefined)).toBe(256 * 2 ** 20);
  });

  it('is a number that the server takes, whatever the machine', () => {
    const { minimum, maximum } = schema.$defs.SubscribeRequest.properties.cache_bytes;
    for (const memory of [0.25, 0.3, 1, 31.9, 32, 64, 1024]) {
      const bytes = cacheBytes(memory);
      expect(Number.isInteger(bytes)).toBe(true);
      expect(bytes).toBeGreaterThanOrEqual(minimum);
      expect(bytes).toBeLessThanOrEqual(maximum);
    }
  });
});
