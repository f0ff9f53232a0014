import { describe, expect, it } from 'vitest';
import { array, DecodeError, number, object, triple } from './decode';

describe('readers', () => {
  const palettes = array(object({ colours: array(triple(number)) }));

  it('name the place of what is wrong, however deep', () => {
    const good = { colours: [[1, 2, 3]] };
    const bad = { colours: [[1, 2, 3], [4, 5, 'six']] }; // prettier-ignore
    expect(palettes([good], 'palettes')).toEqual([good]);
    expect(() => palettes([good, bad], 'palettes')).toThrow(DecodeError);
    expect(() => palettes([good, bad], 'palettes')).toThrow('palettes[1].colours[1][2]');
    expect(() => palettes([good, { colours: 3 }], 'palettes')).toThrow('palettes[1].colours: expected an array');
    expect(() => palettes([{ colours: [[1, 2]] }], 'palettes')).toThrow('palettes[0].colours[0]: expected three values');
  });
});
