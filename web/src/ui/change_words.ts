/** How long ago something was seen and what has changed since, in words. */

import type { Probe } from '../protocol/messages';
import { duration, fixed, reading } from './format';

/** A moment on the clock of whoever looks: "14:02", and the day where it is not today's. */
export function localTime(unix_s: number, now_s: number): string {
  const [at, now] = [new Date(unix_s * 1000), new Date(now_s * 1000)];
  const two = (value: number) => String(value).padStart(2, '0');
  const time = `${two(at.getHours())}:${two(at.getMinutes())}`;
  if (at.toDateString() === now.toDateString()) return time;
  return `${at.toLocaleDateString('en-GB', { day: 'numeric', month: 'short' })} ${time}`;
}

/** A difference of temperatures with its sign. */
export function change(kelvin: number, decimals = 1): string {
  const text = fixed(kelvin, decimals);
  return Number(kelvin.toFixed(decimals)) > 0 ? `+${text}` : text;
}

/** A change with its unit. */
export function kelvin(value: number): string {
  return `${change(value)}\u202fK`;
}

/** "4 min ago, +2.3 since 14:02"; what is not known is not said, and what has nothing before it has not changed. */
export function sinceWords(probe: Probe, now_s: number): string[] {
  const words: string[] = [];
  const { observed_at = null, baseline = null, baseline_at = null, temperature } = probe;
  const looked_at = probe.temperature_at ?? observed_at;
  if (looked_at !== null) words.push(`${duration(Math.max(0, now_s - looked_at))} ago`);
  if (temperature !== null && baseline !== null && baseline_at !== null && baseline_at !== observed_at) {
    words.push(`${change(temperature - baseline)} since ${localTime(baseline_at, now_s)}`);
  }
  return words;
}

/** What was read at a place: "38.1 °C, 4 min ago, +2.3 since 14:02". */
export function probeWords(probe: Probe, now_s: number, decimals = 1): string {
  return [reading(probe, decimals), ...sinceWords(probe, now_s)].join(', ');
}
