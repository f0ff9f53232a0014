/** How sure a temperature is, as one byte of a vertex: even steps of the logarithm, from 10 mK to some 15 K. */

/** Nobody knows: less sure than anything. */
export const UNKNOWN_SIGMA = 255;

const STEPS_PER_DOUBLING = 24;
const LEAST_KELVIN = 0.01;

export function sigmaStep(kelvin: number): number {
  const step = Math.round(STEPS_PER_DOUBLING * Math.log2(kelvin / LEAST_KELVIN));
  return Number.isNaN(step) ? UNKNOWN_SIGMA : Math.min(UNKNOWN_SIGMA - 1, Math.max(0, step));
}
