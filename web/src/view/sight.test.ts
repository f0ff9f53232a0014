import { describe, expect, it } from 'vitest';
import { labOf } from './sight';

type Colour = [number, number, number];

describe('labOf', () => {
  it('is that of CIE 1976 for known colours', () => {
    const expected: [Colour, Colour][] = [
      [
        [255, 255, 255],
        [100, 0, 0],
      ],
      [
        [255, 0, 0],
        [53.24, 80.09, 67.2],
      ],
      [
        [0, 0, 255],
        [32.3, 79.19, -107.86],
      ],
    ];
    for (const [rgb, lab] of expected) labOf(rgb, 'all colours').forEach((value, i) => expect(value).toBeCloseTo(lab[i]!, 1));
  });

  it('leaves greys grey for those who do not see green', () => {
    const [l, a, b] = labOf([120, 120, 120], 'without green');
    expect(l).toBeCloseTo(labOf([120, 120, 120], 'in grey')[0], 1);
    expect(Math.hypot(a, b)).toBeLessThan(0.5);
  });
});
