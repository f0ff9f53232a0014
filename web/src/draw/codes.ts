import type { RawArrays } from './render_messages';

const UNDER_RANGE = 65533;
const OVER_RANGE = 65534;
const MISSING = 65535;

/** degC of a code; see docs/protocol.md. */
export function celsiusOf(code: number, { scale, offset }: Pick<RawArrays, 'scale' | 'offset'>): number {
  if (code === MISSING) return Number.NaN;
  if (code === OVER_RANGE) return Infinity;
  if (code === UNDER_RANGE) return -Infinity;
  return Math.fround(Math.fround(code * scale) + offset);
}
