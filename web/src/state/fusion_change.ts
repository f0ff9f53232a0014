import type { Fusion, FusionChange, Method, ParameterValue } from '../protocol/messages';

/** The change that has the effect of `earlier` followed by `later`. */
export function mergedChange(earlier: FusionChange, later: FusionChange): FusionChange {
  const merged: FusionChange = { ...earlier, ...later };
  if (later.method === undefined && (earlier.params ?? later.params) !== undefined) {
    merged.params = { ...earlier.params, ...later.params };
  }
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
  }
  if (change.params !== undefined) next.params = { ...next.params, ...change.params };
  if (change.palette !== undefined) next.palette = change.palette;
  if (change.missing !== undefined) next.missing = change.missing;
  if (change.range !== undefined) {
    const { mode, min, max } = change.range;
    next.range =
      mode === 'auto' ? { ...fusion.range, mode } : { mode, min: min ?? fusion.range.min, max: max ?? fusion.range.max };
  }
  return next;
}

/** Everything of the settings, as a change: what a new connection is told. */
export function wholeChange(fusion: Fusion): FusionChange {
  const { method, params, palette, range, missing } = fusion;
  return {
    method,
    params,
    palette,
    missing,
    range: range.mode === 'manual' ? { ...range } : { mode: 'auto' },
  };
}
