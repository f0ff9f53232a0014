/** Whether what is on the screen has the palette's own colours. */

import type { Fusion, Method } from '../protocol/messages';

/** The weight of the palette's colour against the visible one; by this name in every method whose formula has one. */
const WEIGHT = 'alpha';

/** Whether a method mixes the palette's colours with the visible ones somewhere, as it is set. */
export function mixesPalette(method: Method | null, fusion: Fusion | null): boolean {
  if (method === null || fusion === null || !method.uses_palette) return false;
  if (fusion.age?.mode === 'fade') return true;
  // A method without this weight mixes in a way of its own.
  return (fusion.params_in_force?.[WEIGHT] ?? fusion.params[WEIGHT]) !== 1;
}
