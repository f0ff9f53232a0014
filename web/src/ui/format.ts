/** Numbers as the instrument writes them. */
import type { DrawnError } from '../tiles/tile_set';

import type { Probe, Scene } from '../protocol/messages';

const THIN_SPACE = '\u202f';
const MINUS = '\u2212';

function signed(text: string): string {
  return text.startsWith('-') ? MINUS + text.slice(1) : text;
}

/** From here on a number is written with a power of ten: a fill value in the data, say, would be 37 digits wide. */
const LARGEST_WRITTEN_OUT = 1e7;
/** From here on no decimals are written. */
const LARGEST_WITH_DECIMALS = 1e6;

function huge(value: number): string {
  return signed(value.toExponential(1).replace('.0', '').replace('+', ''));
}

/** Fixed decimals, with a real minus sign; of large numbers none (1000020), of huge ones two figures: 1.2e36. */
export function fixed(value: number, decimals: number): string {
  if (Math.abs(value) >= LARGEST_WRITTEN_OUT) return huge(value);
  const text = value.toFixed(Math.abs(value) >= LARGEST_WITH_DECIMALS ? 0 : decimals);
  return signed(Number(text) === 0 ? text.replace('-', '') : text);
}

export function withUnit(text: string, unit: string): string {
  return unit === '' ? text : text + THIN_SPACE + unitSymbol(unit);
}

/** The symbol of a wire unit. */
export function unitSymbol(unit: string): string {
  if (unit === 'degC') return '°C';
  return unit === 'deg' ? '°' : unit;
}

/** Infinite: beyond what the sensor could tell. */
export function celsius(value: number | null | undefined, decimals = 1): string {
  if (value === Infinity || value === -Infinity) return value > 0 ? 'over range' : 'under range';
  return value == null ? 'none' : withUnit(fixed(value, decimals), 'degC');
}

/** What there is where the sensor could tell no temperature: "3.60 k over, 12 under range". */
export function beyondWords({ over_range_count: over = 0, under_range_count: under = 0 }: Partial<Scene['temperature']>): string {
  const parts = [...(over > 0 ? [`${count(over)} over`] : []), ...(under > 0 ? [`${count(under)} under`] : [])];
  return `${parts.join(', ')} range`;
}

/** What was read at a place, in words; of how sure it is no less than the last decimal that is shown. */
export function reading(probe: Pick<Probe, 'temperature' | 'temperature_range' | 'temperature_sigma'>, decimals = 1): string {
  const { temperature, temperature_range, temperature_sigma } = probe;
  if (temperature_range != null) return celsius(temperature_range === 'over' ? Infinity : -Infinity);
  if (temperature === null) return 'no temperature';
  return temperature_sigma === undefined
    ? celsius(temperature, decimals)
    : `${fixed(temperature, decimals)} ± ${celsius(Math.max(10 ** -decimals, temperature_sigma), decimals)}`;
}

/** Three figures and an SI prefix: 990 k, 1.97 M. */
export function count(value: number): string {
  const prefixes = ['', 'k', 'M', 'G'];
  let scaled = value;
  let index = 0;
  while (scaled >= 999.5 && index < prefixes.length - 1) {
    scaled /= 1000;
    index += 1;
  }
  const decimals = index === 0 || scaled >= 99.95 ? 0 : scaled >= 9.995 ? 1 : 2;
  return withUnit(fixed(scaled, decimals), prefixes[index] ?? '');
}

export function bytes(value: number): string {
  return value < 1000 ? `${fixed(value, 0)}${THIN_SPACE}B` : `${count(value)}B`;
}

/** A length with a fitting unit, three figures; where nobody has said that the scene is metric, in its own units. */
export function length(value_m: number, isMetric: boolean): string {
  if (!isMetric) return withUnit(figures(value_m, Math.abs(value_m) < 1 ? 2 : 3), 'units');
  const size = Math.abs(value_m);
  if (size === 0) return withUnit('0', 'm');
  if (size < 0.01) return withUnit(figures(value_m * 1000, 2), 'mm');
  if (size < 1) return withUnit(figures(value_m * 100, 2), 'cm');
  return size < 1000 ? withUnit(figures(value_m, 3), 'm') : withUnit(figures(value_m / 1000, 3), 'km');
}

/** A length without a prefix, so that one thousandfold stands out: 3 000, 0.2. */
function grouped(value: number): string {
  const [whole = '', rest] = figures(value, value < 1000 ? 3 : 4).split('.');
  const groups = whole.replace(/\B(?=(\d{3})+$)/g, THIN_SPACE);
  return rest === undefined ? groups : `${groups}.${rest}`;
}

/** Size of a scene along its axes, without its strays: in metres, or in units where nobody has said what they are. */
export function extent({ bounds, core_bounds, metric }: Pick<Scene, 'bounds' | 'core_bounds' | 'metric'>): string {
  const { min, max } = core_bounds ?? bounds;
  const sides = [0, 1, 2].map((axis) => grouped((max[axis] ?? 0) - (min[axis] ?? 0)));
  return withUnit(sides.join(' × '), metric === true ? 'm' : 'units');
}

/** What the size of a scene is, and where its unit comes from. */
export function sizeTitle({ metric }: Pick<Scene, 'metric'>): string {
  const size = 'Size of the scene along x, y and z';
  return metric === true ? size : `${size}. Its file does not say in what unit; --scale S does: metres in one of them`;
}

/** So many significant figures, no exponent, no trailing zeros. */
export function figures(value: number, wanted: number): string {
  if (value === 0) return '0';
  if (Math.abs(value) >= 1e15) return huge(value);
  const decimals = Math.max(0, wanted - 1 - Math.floor(Math.log10(Math.abs(value))));
  return signed(String(Number(value.toFixed(Math.min(12, decimals)))));
}

export function milliseconds(value: number): string {
  return value < 1000 ? `${fixed(value, value < 9.5 ? 1 : 0)}${THIN_SPACE}ms` : `${fixed(value / 1000, 1)}${THIN_SPACE}s`;
}

export function duration(seconds: number): string {
  if (seconds < 100) return `${fixed(Math.floor(seconds), 0)}${THIN_SPACE}s`;
  if (seconds < 6000) return `${fixed(Math.floor(seconds / 60), 0)}${THIN_SPACE}min`;
  return `${fixed(Math.floor(seconds / 3600), 0)}${THIN_SPACE}h`;
}

/** What the status says of a map that grows: how long ago the newest of it was seen. */
export function liveWords(age_s: number | null, isEmpty: boolean, isNarrow: boolean): string {
  if (isEmpty) return 'live, empty';
  if (age_s === null) return 'live';
  const age = age_s < 9.95 ? withUnit(fixed(age_s, 1), 's') : duration(age_s);
  return isNarrow ? `live, ${age}` : `live, newest ${age}`;
}

/** Of a tile that does not know how far it is off. */
const ANY_LEVEL = 255;
/** Nobody wants to know less. */
const LEAST_SAID_M = 1e-6;

/** How exact the picture is, in words: farthest that it may be off, for all but a twentieth of colours and temperatures. */
export function accuracyWords(error: DrawnError | null, isSettled: boolean, isMetric: boolean): string | null {
  if (error === null) return null;
  const { position_m, temperature_celsius, rounding_celsius } = error;
  const colour_levels = error.colour_levels + error.rounding_levels;
  const isOff = colour_levels !== 0 || (temperature_celsius ?? 0) > 0;
  const parts = [`within ${length(Math.max(position_m, LEAST_SAID_M), isMetric)}`];
  // The colours of settings that are in force are still to come.
  if (!isOff && !isSettled) return `coarse: ${parts[0]}`;
  if (!isOff && temperature_celsius !== null && rounding_celsius > 0)
    parts.push(
      `colours to ${withUnit(figures(roundedUp(rounding_celsius, 1 - Math.floor(Math.log10(rounding_celsius))), 2), 'degC')}`,
    );
  else if (!isOff) parts.push('colours exact');
  else if (Number.isNaN(colour_levels) || colour_levels >= ANY_LEVEL) parts.push('colours coarse');
  else parts.push(withUnit(figures(roundedUp(colour_levels, 0), 3), colour_levels > 1 ? 'levels' : 'level'));
  if (isOff && temperature_celsius !== null)
    parts.push(withUnit(figures(roundedUp(temperature_celsius + rounding_celsius, 2), 3), 'degC'));
  return `${isSettled ? '' : 'coarse: '}${parts.join(', ')}`;
}

/** What is said of an error is never smaller than it. */
function roundedUp(value: number, decimals: number): number {
  const step = 10 ** -decimals;
  return Math.ceil(value / step - 1e-6) * step;
}
