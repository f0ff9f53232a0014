import type { Palette } from '../protocol/messages';

/** Greys first, as nothing measured has no hue; then dull hues for palettes that are grey themselves. */
const CANDIDATES = ['#808080', '#5e5e5e', '#a0a0a0', '#7d5480', '#3f7a6c', '#8a6a3c'];

/** Distance in sRGB levels from which a colour is told from a palette's at a glance. */
const WELL_APART = 60;

/** The colour for what has no temperature in a picture of temperatures alone: one that the palette does not come near. */
export function unmeasuredColour(palette: Pick<Palette, 'colours'>): string {
  let best = CANDIDATES[0]!;
  let best_distance = -1;
  for (const candidate of CANDIDATES) {
    const levels = [1, 3, 5].map((at) => parseInt(candidate.slice(at, at + 2), 16));
    const distance = Math.min(...palette.colours.map((colour) => Math.hypot(...levels.map((level, i) => level - colour[i]!))));
    if (distance >= WELL_APART) return candidate;
    if (distance > best_distance) [best, best_distance] = [candidate, distance];
  }
  return best;
}
