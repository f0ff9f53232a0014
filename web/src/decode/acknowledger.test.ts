import { describe, expect, it } from 'vitest';
import { Acknowledger } from './acknowledger';

describe('Acknowledger', () => {
  it('says only what is decoded without a gap', () => {
    const said: number[] = [];
    const acknowledger = new Acknowledger((sequence) => said.push(sequence));
    for (const sequence of [2, 3, 1, 5, 4, 4, 2, 7]) acknowledger.finished(sequence);
    expect(said).toEqual([3, 5]);
    acknowledger.finished(6);
    expect(said).toEqual([3, 5, 7]);
    acknowledger.reset();
    acknowledger.finished(1);
    expect(said.at(-1)).toBe(1);
  });
});
