import { describe, expect, it } from 'vitest';
import { celsiusOf } from './codes';

describe('Temperatures as codes', () => {
  it('give round temperatures as they were written, as the library reads them', () => {
    for (const [step, offset] of [
      [0.01, 20],
      [0.01, -273.15],
      [0.01, 21.37],
      [0.002, -0.5],
      [0.5, 20],
    ] as const) {
      const table = { scale: Math.fround(step), offset: Math.fround(offset) };
      for (let code = 0; code < 65533; code += 7) {
        const written = Math.round((offset + code * step) * 1000) / 1000;
        expect(celsiusOf(code, table)).toBe(Math.fround(written));
      }
    }
  });

  it('of other scales have each operation rounded', () => {
    const [scale, offset] = [0.010000000707805157, Math.fround(20.00123)];
    expect(celsiusOf(250, { scale, offset: 20 })).toBe(Math.fround(Math.fround(250 * scale) + 20));
    expect(celsiusOf(250, { scale: Math.fround(0.01), offset })).toBe(Math.fround(Math.fround(250 * Math.fround(0.01)) + offset));
    expect(celsiusOf(0, { scale: Math.fround(0.01), offset })).toBe(offset);
    expect([65533, 65534, 65535].map((code) => celsiusOf(code, { scale, offset }))).toEqual([-Infinity, Infinity, NaN]);
  });
});
