/** How well what a method highlights is told from the rest by colour alone: measured on the colours of the coarsest tile. */

import { type Colour, labOf, LEAST_DIFFERENCE, type Sight } from './sight';

/** Seen without green and in grey: the difference (CIE 1976) that all but a twentieth of the pairs of a highlighted vertex and another one exceed. */
export interface HighlightContrast {
  without_green: number;
  in_grey: number;
}

/** Pairs that may look alike while highlights still stand out as a whole. */
const SHARE_ALIKE = 0.05;
/** Colours are taken together that agree in so many bits a channel, and of them the commonest count. */
const BITS = 5;
const MOST_COLOURS = 512;
/** Differences from here on are one. */
const MOST_DIFFERENCE = 256;

interface Tally {
  colour: Colour;
  count: number;
}

/** Null where nothing is highlighted, or everything. `rgba`: alpha 0 is highlighted, as the decoder gives it. */
export function highlightContrast(rgba: Uint8Array): HighlightContrast | null {
  const highlighted = new Uint32Array(1 << (3 * BITS));
  const rest = new Uint32Array(1 << (3 * BITS));
  const drop = 8 - BITS;
  for (let i = 0; i < rgba.length; i += 4) {
    const cell = ((rgba[i]! >> drop) << (2 * BITS)) | ((rgba[i + 1]! >> drop) << BITS) | (rgba[i + 2]! >> drop);
    const counts = rgba[i + 3]! < 128 ? highlighted : rest;
    counts[cell]! += 1;
  }
  const [these, others] = [commonest(highlighted), commonest(rest)];
  if (these.length === 0 || others.length === 0) return null;
  return { without_green: difference(these, others, 'without green'), in_grey: difference(these, others, 'in grey') };
}

/** Colours alone do not show everybody what is highlighted. */
export function needsOutline({ without_green, in_grey }: HighlightContrast): boolean {
  return Math.min(without_green, in_grey) < LEAST_DIFFERENCE;
}

function commonest(counts: Uint32Array): Tally[] {
  const tallies: Tally[] = [];
  const mask = (1 << BITS) - 1;
  const middle = (cell: number) => ((cell & mask) + 0.5) * (1 << (8 - BITS)) - 0.5;
  counts.forEach((count, cell) => {
    if (count > 0) tallies.push({ colour: [middle(cell >> (2 * BITS)), middle(cell >> BITS), middle(cell)], count });
  });
  return tallies.sort((a, b) => b.count - a.count).slice(0, MOST_COLOURS);
}

function difference(these: Tally[], others: Tally[], sight: Sight): number {
  const seen = others.map(({ colour }) => labOf(colour, sight));
  const pairs = new Float64Array(MOST_DIFFERENCE + 1);
  let total = 0;
  for (const { colour, count } of these) {
    const [l, a, b] = labOf(colour, sight);
    for (let i = 0; i < seen.length; i += 1) {
      const other = seen[i]!;
      const apart = Math.sqrt((l - other[0]) ** 2 + (a - other[1]) ** 2 + (b - other[2]) ** 2);
      const weight = count * others[i]!.count;
      pairs[Math.min(MOST_DIFFERENCE, Math.floor(apart))]! += weight;
      total += weight;
    }
  }
  let alike = 0;
  for (let apart = 0; apart < MOST_DIFFERENCE; apart += 1) {
    alike += pairs[apart]!;
    if (alike > SHARE_ALIKE * total) return apart;
  }
  return MOST_DIFFERENCE;
}
