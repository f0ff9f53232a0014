/** The ends of a scale of temperatures, where it has some. */
export type Ends = { min?: number | null | undefined; max?: number | null | undefined } | undefined;

/** How many decimals tell temperatures of every one of these scales apart: a hundredth of the narrowest; never less than one. */
export function decimalsOf(...scales: Ends[]): number {
  const spans = scales.map((ends) => (ends?.min == null || ends.max == null ? 0 : ends.max - ends.min));
  const narrowest = Math.min(...spans.filter((span) => span > 0));
  return Math.min(4, Math.max(1, 1 - Math.floor(Math.log10(narrowest))));
}
