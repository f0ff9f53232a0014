/** Scales: the temperature axis' ticks and the sliders' travel. */

import type { Parameter } from '../protocol/messages';

/** Round numbers from lo to hi, at most about `wanted`, and how many decimals they need. */
export function roundTicks(lo: number, hi: number, wanted: number): { values: number[]; step: number; decimals: number } {
  const span = hi - lo;
  if (!(span > 0) || !Number.isFinite(span)) return { values: [lo], step: 1, decimals: 1 };
  const raw = span / Math.max(1, wanted);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999) ?? 10);
  const values: number[] = [];
  for (let i = Math.ceil(lo / step - 1e-9); i * step <= hi + step * 1e-9; i += 1) values.push(i * step);
  return { values, step, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** About as wide as a text is on the axis, in pixels, in the widest of the usual fonts. */
export function textWidth(text: string, isBold: boolean): number {
  const points = text.split('.').length - 1;
  return (text.length - points) * (isBold ? 8 : 7.3) + points * 4.4 + (text.split('\u2212').length - 1) * 2.3;
}

/** Width of the column left of the strip, so that it holds these numbers, the tick beside them, and the arrow beside the bold ones. */
export function columnWidth(numbers: readonly string[], bold: readonly string[]): number {
  return Math.ceil(
    Math.max(0, ...numbers.map((text) => textWidth(text, false) + 10), ...bold.map((text) => textWidth(text, true) + 11)),
  );
}

/** Those `count` of the items, in their order, whose rank is lowest; the first of equals. */
export function mostImportant<T>(items: readonly T[], count: number, rank: (item: T) => number): T[] {
  const kept = new Set([...items.keys()].sort((a, b) => rank(items[a]!) - rank(items[b]!) || a - b).slice(0, count));
  return items.filter((_, index) => kept.has(index));
}

/** The travel of a slider: where values are between its two ends. */
export interface Travel {
  min: number;
  max: number;
  /** Values are min + (max - min) * position^power. */
  power: number;
  step: number;
  whole: boolean;
}

/** Past this ratio of range to default an even slider would leave no room where it matters: the default is put in the middle. */
const UNEVEN_RATIO = 12;

/** The travel for a number or integer parameter; an open upper end is given a sensible one. */
export function travelOf(parameter: Parameter): Travel {
  const whole = parameter.kind === 'integer';
  // An angle goes round once.
  if (parameter.unit === 'deg' && parameter.min === undefined && parameter.max === undefined) {
    return { min: 0, max: 360, power: 1, step: parameter.step ?? 0, whole };
  }
  // Where the default is automatic, what is usual is taken to lie near the lower end of a wide range.
  const automatic = (parameter.min ?? 0) + ((parameter.max ?? 0) - (parameter.min ?? 0)) / 64;
  const standard = typeof parameter.default === 'number' ? parameter.default : parameter.max === undefined ? 0 : automatic;
  const lower = parameter.min ?? parameter.exclusive_min ?? Math.min(0, standard);
  const max = parameter.max ?? lower + Math.max(1, Math.abs(standard - lower)) * 8;
  const step = parameter.step !== undefined && parameter.step > 0 ? parameter.step : whole ? 1 : 0;
  const open = parameter.min === undefined && parameter.exclusive_min !== undefined;
  const min = open ? lower + (step > 0 ? step : (max - lower) / 1000) : lower;
  const share = (standard - min) / (max - min);
  const power = share > 0 && share < 1 / UNEVEN_RATIO ? Math.log(share) / Math.log(0.5) : 1;
  return { min, max, power, step, whole };
}

/** Position 0..1 of a value on its slider. */
export function positionOf(travel: Travel, value: number): number {
  const share = (value - travel.min) / (travel.max - travel.min || 1);
  return Math.min(1, Math.max(0, share)) ** (1 / travel.power);
}

/** The value at a position, rounded as the parameter wants it. */
export function valueAt(travel: Travel, position: number): number {
  const { min, max, power, step, whole } = travel;
  const exact = min + (max - min) * Math.min(1, Math.max(0, position)) ** power;
  if (whole) return Math.round(exact);
  // On an uneven scale one step is much near one end and nothing near the other: three figures are finer than a hand.
  const rounded = power === 1 && step > 0 ? Math.round((exact - min) / step) * step + min : Number(exact.toPrecision(3));
  return Math.min(max, Math.max(min, Number(rounded.toPrecision(12))));
}

/**
 * Which share of counted values lies below and above a range; a bin that the end of the range cuts counts in part, but never for more
 * than `most`: that readings are spread over a bin is a guess, and sensors give steps.
 */
export function sharesBeyond(
  { edges, counts }: { edges: readonly number[]; counts: readonly number[] },
  lo: number,
  hi: number,
  most = { below: 1, above: 1 },
): { below: number; above: number } {
  let below = 0;
  let above = 0;
  let all = 0;
  counts.forEach((count, index) => {
    const from = edges[index] ?? 0;
    const to = edges[index + 1] ?? from;
    // In a scene of one temperature the bin has no width: it is inside where its value is.
    const part = (end: number) => (to > from ? Math.min(1, Math.max(0, (end - from) / (to - from))) : end > from ? 1 : 0);
    all += count;
    // Whole vertices: a sliver of a bin that an end cuts is nobody.
    below += Math.floor(count * part(lo));
    above += Math.floor(count * (1 - (to > from ? part(hi) : hi >= from ? 1 : 0)));
  });
  if (all === 0) return { below: 0, above: 0 };
  return { below: Math.min(below / all, most.below), above: Math.min(above / all, most.above) };
}

/** Moves labels apart so that none stands closer than `gap` to the next; keeps their order and stays inside lo..hi where it can. */
export function spreadApart(wanted: readonly number[], gap: number, lo: number, hi: number): number[] {
  const order = wanted.map((_, index) => index).sort((a, b) => (wanted[a] ?? 0) - (wanted[b] ?? 0));
  const placed = [...wanted];
  let floor = lo;
  for (const index of order) {
    const place = Math.max(placed[index] ?? 0, floor);
    placed[index] = place;
    floor = place + gap;
  }
  let ceiling = hi;
  for (const index of order.reverse()) {
    const place = Math.min(placed[index] ?? 0, ceiling);
    placed[index] = place;
    ceiling = place - gap;
  }
  return placed;
}
