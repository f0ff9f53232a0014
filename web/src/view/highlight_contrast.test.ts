import { describe, expect, it } from 'vitest';
import { highlightContrast, needsOutline } from './highlight_contrast';

type Colour = [number, number, number];
/** So many vertices of a colour each. */
const vertices = (...groups: [count: number, colour: Colour, isHighlighted: boolean][]) =>
  Uint8Array.from(
    groups.flatMap(([count, colour, isHighlighted]) =>
      Array.from({ length: count }, () => [...colour, isHighlighted ? 0 : 255]).flat(),
    ),
  );
const GREEN: Colour = [110, 130, 60];
const RED: Colour = [200, 84, 60];
const PALE: Colour = [250, 250, 120];
const DARK: Colour = [40, 40, 44];

describe('highlightContrast', () => {
  it('is none where there is nothing to compare', () => {
    expect(highlightContrast(vertices([5, RED, false]))).toBeNull();
    expect(highlightContrast(vertices([5, RED, true]))).toBeNull();
    expect(highlightContrast(new Uint8Array(0))).toBeNull();
  });

  it('finds light highlights in the dark whatever the eyes are', () => {
    const contrast = highlightContrast(vertices([1000, DARK, false], [3, PALE, true]))!;
    expect(contrast.in_grey).toBeGreaterThan(60);
    expect(contrast.without_green).toBeGreaterThan(60);
    expect(needsOutline(contrast)).toBe(false);
  });

  it('finds that red is as light as green, and outlines it', () => {
    const contrast = highlightContrast(vertices([1000, GREEN, false], [3, RED, true]))!;
    expect(contrast.in_grey).toBeLessThan(10);
    expect(needsOutline(contrast)).toBe(true);
  });

  it('outlines where in grey alone highlights are lost', () => {
    // Blue on grey of its lightness: everybody tells them apart who sees colours.
    const contrast = highlightContrast(vertices([1000, [118, 118, 118], false], [9, [70, 110, 230], true]))!;
    expect(contrast.without_green).toBeGreaterThan(10);
    expect(contrast.in_grey).toBeLessThan(10);
    expect(needsOutline(contrast)).toBe(true);
  });

  it('forgives a twentieth of the rest that looks like a highlight, and no more', () => {
    const outlined = (share: number) =>
      needsOutline(highlightContrast(vertices([1000 - share, DARK, false], [share, PALE, false], [7, PALE, true]))!);
    expect(outlined(40)).toBe(false);
    expect(outlined(60)).toBe(true);
  });
});
