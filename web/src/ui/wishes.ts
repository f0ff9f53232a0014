import type { FusionChange, Method, Palette } from '../protocol/messages';
import { decimalsOf } from '../state/decimals';
import { celsius, figures } from './format';

/** What a change asks for, in words: one entry a setting. */
export function wishWords(
  change: FusionChange | null,
  methods: readonly Method[],
  palettes: readonly Palette[],
  method: string,
  /** Of a temperature. */
  decimals = 1,
): string[] {
  if (change === null) return [];
  const words: string[] = [];
  const wanted = methods.find(({ id }) => id === (change.method ?? method));
  if (change.method !== undefined) words.push(wanted?.label ?? change.method);
  for (const [name, value] of Object.entries(change.params ?? {})) {
    const parameter = wanted?.params.find((one) => one.name === name);
    const shown =
      value === null
        ? 'automatic'
        : typeof value !== 'number'
          ? String(value)
          : parameter?.kind === 'temperature'
            ? celsius(value, decimals)
            : figures(value, 3);
    words.push(`${parameter?.label ?? name} ${shown}`);
  }
  const palette = change.palette;
  if (palette !== undefined) words.push(`palette ${palettes.find(({ id }) => id === palette)?.label ?? palette}`);
  if (change.range !== undefined) {
    const { mode, min, max, low, high } = change.range;
    if (mode === 'manual') {
      const telling = decimalsOf({ min, max });
      words.push(`range ${celsius(min, telling)} to ${celsius(max, telling)}`);
    } else if (mode === 'auto') words.push('range to the extremes');
    else words.push(`range ${figures(low ?? 1, 3)}\u2013${figures(high ?? 99, 3)} %`);
  }
  if (change.age?.mode !== undefined) words.push(change.age.mode === 'fade' ? 'fading by age' : 'no fading by age');
  if (change.age?.half_life_s !== undefined) words.push(`half-life ${figures(change.age.half_life_s, 3)} s`);
  if (change.missing !== undefined) words.push('colour of what has no temperature');
  return words;
}

/** Paths of the settings that a change asks for, such as `params.alpha`: where each stands among the controls. */
export function wishPaths(change: FusionChange | null): string[] {
  if (change === null) return [];
  const { params, ...others } = change;
  return [...Object.keys(others), ...Object.keys(params ?? {}).map((name) => `params.${name}`)];
}
