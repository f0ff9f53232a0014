import type { RawArrays } from './render_messages';

const UNDER_RANGE = 65533;
const OVER_RANGE = 65534;
const MISSING = 65535;
const FARTHEST_STEP = 2 ** 22;

/** degC of a code; see docs/protocol.md. */
export function celsiusOf(code: number, { scale, offset }: Pick<RawArrays, 'scale' | 'offset'>): number {
  if (code === MISSING) return Number.NaN;
  if (code === OVER_RANGE) return Infinity;
  if (code === UNDER_RANGE) return -Infinity;
  const per_degree = Math.round(1 / scale);
  const first = Math.round(offset * per_degree);
  const isWholePart = Math.fround(1 / per_degree) === scale && Math.fround(first / per_degree) === offset;
  if (isWholePart && Math.abs(first) <= FARTHEST_STEP) return Math.fround((first + code) / per_degree);
  return Math.fround(Math.fround(code * scale) + offset);
}
