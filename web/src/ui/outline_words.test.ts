import { describe, expect, it } from 'vitest';
import { outlineWords } from './outline_words';

describe('outlineWords', () => {
  it('says what was decided, for whom, and from which value on', () => {
    expect(outlineWords({ without_green: 14, in_grey: 3 })).toBe(
      'Outlined: in grey, many highlights look like the rest (difference 3, under 10).',
    );
    expect(outlineWords({ without_green: 9, in_grey: 12 })).toMatch(/^Outlined: red-green blind, many/);
    expect(outlineWords({ without_green: 9, in_grey: 2 })).toMatch(/^Outlined: red-green blind and in grey, many/);
    expect(outlineWords({ without_green: 31, in_grey: 10 })).toBe(
      'Not outlined: red-green blind and in grey, highlights differ from the rest by 10; under 10 they would be.',
    );
  });
});
