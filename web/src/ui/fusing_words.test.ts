import { describe, expect, it } from 'vitest';
import { type FusingFacts, fusingWords } from './fusing_words';

const FACTS: FusingFacts = {
  place: 'robot',
  wish: 'automatic',
  isPossible: true,
  problem: null,
  share: 0,
  vertices: 1_000_000,
  rate: 625_000,
};

describe('fusingWords', () => {
  it('say what either costs on this link', () => {
    const words = (facts: FusingFacts) => fusingWords(facts).cost.replaceAll('\u202f', ' ');
    expect(words(FACTS)).toBe('Here: about 2.10 MB, 3 s once, nothing for a setting. On the robot: up to 1.60 MB, 2 s for each.');
    expect(words({ ...FACTS, rate: 1e8 })).toContain('2.10 MB, under 1 s once');
    expect(words({ ...FACTS, rate: null })).toMatch(/^Here: about 2\.10 MB once/);
  });

  it('say where colours are made, and why', () => {
    expect(fusingWords({ ...FACTS, place: 'here' }).now).toBe('Here: a setting needs no link.');
    expect(fusingWords({ ...FACTS, place: 'coming', share: 0.254 }).now).toContain('25 %');
    expect(fusingWords({ ...FACTS, problem: 'it broke' }).now).toBe('On the robot: it broke');
    expect(fusingWords({ ...FACTS, isPossible: false }).now).toContain('no library');
    expect(fusingWords(FACTS).now).toContain('longer than');
    expect(fusingWords({ ...FACTS, wish: 'robot', isPossible: false }).now).toBe('On the robot.');
  });
});
