import type { Fusion, FusionChange, Method, ParameterValue, Range, RangeChange } from '../protocol/messages';

/** Of a server that does not know of age. */
const NO_AGE = { mode: 'off', half_life_s: 300 } as const;

/** The change that has the effect of `earlier` followed by `later`. */
export function mergedChange(earlier: FusionChange, later: FusionChange): FusionChange {
  const merged: FusionChange = { ...earlier, ...later };
  if (later.method === undefined && (earlier.params ?? later.params) !== undefined) {
    merged.params = { ...earlier.params, ...later.params };
  }
  if (earlier.age !== undefined && later.age !== undefined) merged.age = { ...earlier.age, ...later.age };
  // A new method starts at its defaults: parameters of the one before mean nothing to it.
  if (later.method !== undefined && later.params === undefined) delete merged.params;
  return merged;
}

export function defaultParams(method: Method | undefined): Record<string, ParameterValue> {
  return Object.fromEntries((method?.params ?? []).map((parameter) => [parameter.name, parameter.default]));
}

/** The settings as they will be once `change` has been accepted. */
export function withChange(fusion: Fusion, change: FusionChange | null, methods: readonly Method[]): Fusion {
  if (change === null) return fusion;
  const next: Fusion = { ...fusion };
  if (change.method !== undefined && change.method !== fusion.method) {
    next.method = change.method;
    next.params = defaultParams(methods.find((method) => method.id === change.method));
    next.params_in_force = {};
    // Only the server knows what the palette of another method stands for.
    delete next.change_scale;
  }
  if (change.params !== undefined) next.params = { ...next.params, ...change.params };
  if (change.palette !== undefined) next.palette = change.palette;
  if (change.missing !== undefined) next.missing = change.missing;
  if (change.age !== undefined) next.age = { ...(fusion.age ?? NO_AGE), ...change.age };
  if (change.range !== undefined) {
    const { mode, min, max } = change.range;
    // Which temperatures a range that follows the scene comes to, only the server knows.
    if (mode === 'manual') next.range = { mode, min: min ?? fusion.range.min, max: max ?? fusion.range.max };
    else next.range = { min: fusion.range.min, max: fusion.range.max, ...rangeChange(change.range) };
  }
  return next;
}

/** Everything of the settings, as a change: what a new connection is told. */
export function wholeChange(fusion: Fusion): FusionChange {
  const { method, params, palette, range, missing, age } = fusion;
  return {
    ...(age === undefined ? {} : { age }),
    method,
    params,
    palette,
    missing,
    range: rangeChange(range),
  };
}

/** What somebody has set that decides which temperatures are highlighted; equal texts where it is the same. */
export function highlightKey({ method, params, range }: Fusion): string {
  const sorted = Object.entries(params).sort(([a], [b]) => (a < b ? -1 : 1));
  const held = range.mode === 'manual' ? [range.min, range.max] : range.mode;
  // The same number may have come by another way, rounded.
  return JSON.stringify([method, sorted, held], (_key, value: unknown) =>
    typeof value === 'number' ? Number(value.toPrecision(6)) : value,
  );
}

/** What sets a range that is in force. */
export function rangeChange({ mode, min, max, low, high }: Range | RangeChange): RangeChange {
  if (mode === 'manual') return { mode, min: min ?? null, max: max ?? null };
  if (mode === 'auto') return { mode };
  return { mode, ...(low === undefined ? {} : { low }), ...(high === undefined ? {} : { high }) };
}
