import { describe, expect, it } from 'vitest';
import { LEAST_DIFFERENCE } from '../view/sight';
import { faresOf, fareWords } from './palette_fare';

type Colour = [number, number, number];
const palette = (at: (share: number) => Colour) => ({
  id: 'p',
  label: 'P',
  fusion_safe: false,
  colours: Array.from({ length: 256 }, (_, row) => at(row / 255)),
});
const grey = palette((share) => [share * 255, share * 255, share * 255]);
/** From green to red of about the same lightness. */
const greenToRed = palette((share) => [150 + 70 * share, 130 - 60 * share, 60]);

describe('faresOf', () => {
  it('finds that a grey palette fares the same with every eye', () => {
    for (const { difference } of faresOf(grey)) expect(difference).toBeGreaterThan(LEAST_DIFFERENCE);
    expect(fareWords(grey, { min: 0, max: 100 }, String)[2]).toBe('In grey: temperatures stay apart.');
  });

  it('finds that green to red is lost without green', () => {
    const [all, without] = faresOf(greenToRed);
    expect(all!.difference).toBeGreaterThan(without!.difference);
    expect(without!.difference).toBeLessThan(LEAST_DIFFERENCE);
  });

  it('names two temperatures that are mistaken for one another, a quarter of the range apart or more', () => {
    // Up and down again: the ends are alike.
    const hill = palette((share) => [255 * (1 - Math.abs(2 * share - 1)), 128, 128]);
    const { rows, difference } = faresOf(hill)[0]!;
    expect(difference).toBeLessThan(1);
    expect(rows[0] + rows[1]).toBe(255);
    expect(rows[1] - rows[0]).toBeGreaterThanOrEqual(64);
    expect(fareWords(hill, { min: 10, max: 20 }, (value) => value.toFixed(1))[0]).toBe('With all colours: 10.0 looks like 20.0.');
    expect(fareWords(hill, null, String)[0]).toBe('With all colours: some temperatures look alike.');
  });
});
