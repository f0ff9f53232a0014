import { describe, expect, it } from 'vitest';
import { unmeasuredColour } from './unmeasured';

type Colour = [number, number, number];
const ramp = (at: (t: number) => Colour) => ({ colours: Array.from({ length: 256 }, (_, i) => at(i / 255)) });
const channels = (hex: string) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

describe('The colour of what has no temperature', () => {
  it('is grey where the palette is not', () => {
    const [r, g, b] = channels(unmeasuredColour(ramp((t) => [255 * t, 0, 255 * (1 - t)])));
    expect([g, b]).toEqual([r, r]);
  });

  it('is no grey where the palette is one', () => {
    const [r, g] = channels(unmeasuredColour(ramp((t) => [255 * t, 255 * t, 255 * t])));
    expect(Math.abs(r! - g!)).toBeGreaterThan(30);
  });

  it('is the farthest one where every candidate is near', () => {
    const { colours } = ramp((t) => [255 * t, 255 * t, 255 * t]);
    const all = { colours: [...colours, ...['#7d5480', '#3f7a6c'].map((hex) => channels(hex) as Colour)] };
    expect(unmeasuredColour(all)).toBe('#8a6a3c');
  });
});
