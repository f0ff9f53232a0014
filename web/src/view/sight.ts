/** How colours look to eyes, and on prints, that do not tell all of them apart. */

/** Two colours that differ by less (CIE 1976, units of L*a*b*) are taken for one another at a glance. */
export const LEAST_DIFFERENCE = 10;

export type Colour = readonly [number, number, number];
export type Sight = 'all colours' | 'without green' | 'in grey';

/** Deuteranopia on linear RGB: Machado, Oliveira and Fernandes 2009, severity 1. */
const WITHOUT_GREEN = [
  [0.367322, 0.860646, -0.227968],
  [0.280085, 0.672501, 0.047413],
  [-0.01182, 0.04294, 0.968881],
] as const;
/** Luminance of linear sRGB, and white, of D65. */
const TO_XYZ = [
  [0.4124564, 0.3575761, 0.1804375],
  [0.2126729, 0.7151522, 0.072175],
  [0.0193339, 0.119192, 0.9503041],
] as const;
const WHITE = [0.95047, 1, 1.08883] as const;

function times(matrix: readonly Colour[], [r, g, b]: Colour): [number, number, number] {
  return matrix.map(([x, y, z]) => x * r + y * g + z * b) as [number, number, number];
}

function linear(value: number): number {
  const share = value / 255;
  return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
}

/** L*, a*, b* of an sRGB colour (0..255) as it is seen. */
export function labOf(colour: Colour, sight: Sight): [number, number, number] {
  let light = colour.map(linear) as [number, number, number];
  if (sight === 'without green')
    light = times(WITHOUT_GREEN, light).map((value) => Math.min(1, Math.max(0, value))) as typeof light;
  const xyz = times(TO_XYZ, light);
  const [x, y, z] = xyz.map((value, i) => {
    const share = value / WHITE[i]!;
    return share > 216 / 24389 ? Math.cbrt(share) : (share * (24389 / 27) + 16) / 116;
  }) as [number, number, number];
  const lightness = 116 * y - 16;
  return sight === 'in grey' ? [lightness, 0, 0] : [lightness, 500 * (x - y), 200 * (y - z)];
}
