/** How much a method highlights, in words. */

import type { Histogram, Method, ParameterValue } from '../protocol/messages';
import { celsius, figures, fixed, withUnit } from './format';

/** A share as a person reads it: never rounded to nothing, nor to all. */
export function percent(share: number): string {
  const hundredth = share * 100;
  if (hundredth <= 0) return withUnit('0', '%');
  if (hundredth >= 100) return withUnit('100', '%');
  if (hundredth < 0.01) return `under ${withUnit('0.01', '%')}`;
  if (hundredth > 99.9) return `over ${withUnit('99.9', '%')}`;
  return withUnit(hundredth < 0.995 ? figures(hundredth, 2) : fixed(hundredth, hundredth < 9.95 || hundredth > 99 ? 1 : 0), '%');
}

/** Where the highlighted temperatures lie, within the lowest and highest of the scene. */
function places(
  highlighted: readonly (readonly [number, number])[],
  lowest: number,
  highest: number,
  said: (value: number) => string,
): string {
  if (highlighted.length > 2) return `in ${highlighted.length} bands of temperature`;
  return highlighted
    .map(([from, to]) => {
      if (from <= lowest && to >= highest) return 'at every temperature';
      if (to >= highest) return `above ${said(from)}`;
      return from <= lowest ? `below ${said(to)}` : `from ${said(from)} to ${said(to)}`;
    })
    .join(' or ');
}

/** How much is highlighted is not known yet. */
export const NOT_KNOWN_YET = '…';

/**
 * One sentence: "0.3 % of the surface, above 27.4 °C", or that nothing is highlighted; and of thresholds that lie beyond the
 * data that they do. Null for a method that shows all temperatures alike.
 */
export function highlightWords(
  histogram: Histogram | null,
  scene: { lowest: number | null; highest: number | null; isPointCloud: boolean; decimals: number },
  method: Method | null,
  inForce: Record<string, ParameterValue>,
): string | null {
  const share = histogram?.highlighted_share;
  const { lowest, highest } = scene;
  if (histogram === null || share === undefined || lowest === null || highest === null) return null;
  const said = (value: number) => celsius(value, scene.decimals);
  const beyond = (method?.params ?? []).flatMap(({ kind, name, label }) => {
    const value = inForce[name];
    if (kind !== 'temperature' || typeof value !== 'number' || (value >= lowest && value <= highest)) return [];
    const where = value > highest ? `above the hottest, ${said(highest)}` : `below the coldest, ${said(lowest)}`;
    return [`${label} ${said(value)} is ${where}.`];
  });
  // The map may be another one by now than that of which the share is.
  const from = Math.max(lowest, histogram.edges[0] ?? lowest);
  const to = Math.min(highest, histogram.edges.at(-1) ?? highest);
  const of = scene.isPointCloud ? 'points' : 'surface';
  const found =
    share === 0
      ? 'Nothing is highlighted.'
      : `${percent(share)} of the ${of}${histogram.highlighted.length > 0 ? `, ${places(histogram.highlighted, from, to, said)}` : ''}.`;
  return [found, ...beyond].join(' ');
}
