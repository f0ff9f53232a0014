/** How a palette fares with eyes, and with prints, that do not tell its colours apart: computed from its colours. */

import type { Palette } from '../protocol/messages';
import { type Colour, labOf, LEAST_DIFFERENCE, type Sight } from '../view/sight';

/** Temperatures as far apart as this share of the range ought to be told apart. */
export const SHARE_APART = 0.25;

export interface Fare {
  sight: Sight;
  /** The smallest difference of two colours that are far enough apart, and their rows, 0 the coldest. */
  difference: number;
  rows: [number, number];
}

const known = new WeakMap<Palette, Fare[]>();

/** For each way to see: the two temperatures, a quarter of the range or more apart, that look most alike. */
export function faresOf(palette: Palette): Fare[] {
  let fares = known.get(palette);
  if (fares === undefined) {
    fares = (['all colours', 'without green', 'in grey'] as const).map((sight) => fareOf(palette.colours, sight));
    known.set(palette, fares);
  }
  return fares;
}

function fareOf(colours: readonly Colour[], sight: Sight): Fare {
  const seen = colours.map((colour) => labOf(colour, sight));
  const apart = Math.ceil((colours.length - 1) * SHARE_APART);
  let rows: [number, number] = [0, colours.length - 1];
  let least = Infinity;
  // Some twenty thousand pairs, within a task of the page: plain numbers only.
  for (let i = 0; i < seen.length; i += 1) {
    const [l, a, b] = seen[i]!;
    for (let j = i + apart; j < seen.length; j += 1) {
      const other = seen[j]!;
      const squared = (l - other[0]) ** 2 + (a - other[1]) ** 2 + (b - other[2]) ** 2;
      if (squared >= least) continue;
      least = squared;
      rows = [i, j];
    }
  }
  return { sight, difference: Math.sqrt(least), rows };
}

/** In words, with the temperatures that are mistaken for one another; `range` is the active one. */
export function fareWords(
  palette: Palette,
  range: { min: number; max: number } | null,
  celsius: (value: number) => string,
): string[] {
  return faresOf(palette).map(({ sight, difference, rows }) => {
    const who = { 'all colours': 'With all colours', 'without green': 'Red-green blind', 'in grey': 'In grey' }[sight];
    if (difference >= LEAST_DIFFERENCE) return `${who}: temperatures stay apart.`;
    if (range === null || range.max <= range.min) return `${who}: some temperatures look alike.`;
    const [cold, hot] = rows.map((row) => range.min + ((range.max - range.min) * row) / (palette.colours.length - 1));
    return `${who}: ${celsius(cold!)} looks like ${celsius(hot!)}.`;
  });
}
