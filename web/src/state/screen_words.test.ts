import { describe, expect, it } from 'vitest';
import { ScreenWords } from './screen_words';

const error = (position_m: number, colour_levels: number, temperature_celsius: number | null = null) => ({
  position_m,
  colour_levels,
  temperature_celsius,
  rounding_levels: 0,
  rounding_celsius: 0,
});

describe('What is said of the screen', () => {
  it('is no better than the picture that has been drawn, and those on their way', () => {
    const words = new ScreenWords();
    words.pictureIs(1, { error: null, methods: [] });
    expect(words.afterPicture(0)).toEqual({ error: null, methods: [] });
    words.pictureIs(2, { error: error(0.08, 3), methods: ['blend'] });
    expect(words.afterPicture(2)).toEqual({ error: error(0.08, 3), methods: ['blend'] });
    words.pictureIs(3, { error: error(0.003, 4, 0.5), methods: ['thermal', 'blend', 'thermal'] });
    words.pictureIs(4, { error: error(0.003, 0, 0), methods: ['thermal'] });
    expect(words.afterPicture(2)).toEqual({ error: error(0.08, 4, 0.5), methods: ['blend', 'thermal'] });
    expect(words.afterPicture(3)).toEqual({ error: error(0.003, 4, 0.5), methods: ['blend', 'thermal'] });
    expect(words.afterPicture(4)).toEqual({ error: error(0.003, 0, 0), methods: ['thermal'] });
    // A picture that is put together anew before it is sent has never been seen.
    words.pictureIs(5, { error: error(1, 0), methods: ['blend'] });
    words.pictureIs(5, { error: null, methods: [] });
    expect(words.afterPicture(4)).toEqual({ error: error(0.003, 0, 0), methods: ['thermal'] });
    expect(words.afterPicture(6)).toEqual({ error: null, methods: [] });
  });
});
