/** What automatic has decided about the outline of highlights, in words. */

import { type HighlightContrast, needsOutline } from '../view/highlight_contrast';
import { LEAST_DIFFERENCE } from '../view/sight';

export const OUTLINE_HELP = `A light and a dark line around what is highlighted. Automatic: where, red-green blind or in grey, highlights and the rest differ by less than ${LEAST_DIFFERENCE} (CIE 1976).`;

export function outlineWords(contrast: HighlightContrast): string {
  const { without_green, in_grey } = contrast;
  const least = Math.min(without_green, in_grey);
  if (!needsOutline(contrast))
    return `Not outlined: red-green blind and in grey, highlights differ from the rest by ${least}; under ${LEAST_DIFFERENCE} they would be.`;
  const who =
    without_green >= LEAST_DIFFERENCE
      ? 'in grey'
      : in_grey >= LEAST_DIFFERENCE
        ? 'red-green blind'
        : 'red-green blind and in grey';
  return `Outlined: ${who}, many highlights look like the rest (difference ${least}, under ${LEAST_DIFFERENCE}).`;
}
