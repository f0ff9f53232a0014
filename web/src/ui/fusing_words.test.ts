import { describe, expect, it } from 'vitest';
import { type FusingFacts, fusingWords } from './fusing_words';

const FACTS: FusingFacts = {
  place: 'robot',
  wish: 'automatic',
  isPossible: true,
  problem: null,
  share: 0,
  unfit: null,
  hasLibrary: true,
  counted_bytes: null,
  costs: { raw_bytes: 2.1e6, change_bytes: 1.6e6 },
  rate: 625_000,
};

describe('fusingWords', () => {
  it('say what either costs on this link', () => {
    const words = (facts: FusingFacts) => fusingWords(facts).cost.replaceAll('\u202f', ' ');
    expect(words(FACTS)).toBe('Here: about 2.10 MB, 3 s once, nothing for a setting. On the robot: up to 1.60 MB, 2 s for each.');
    expect(words({ ...FACTS, counted_bytes: 1234 })).toContain('for a setting what the robot counts, 1.23 kB, under 1 s.');
    expect(words({ ...FACTS, rate: 1e8 })).toContain('2.10 MB, under 1 s once');
    expect(words({ ...FACTS, rate: null })).toMatch(/^Here: about 2\.10 MB once/);
  });

  it('say where colours are made, and why', () => {
    expect(fusingWords({ ...FACTS, place: 'here' }).now).toBe('Here: a setting needs no link.');
    expect(fusingWords({ ...FACTS, place: 'here', counted_bytes: 1 }).now).toBe('Here; for some settings the robot counts.');
    expect(fusingWords({ ...FACTS, place: 'here', problem: 'it fades' }).now).toBe('Here until the robot has made it: it fades');
    expect(fusingWords({ ...FACTS, place: 'coming', share: 0.254 }).now).toContain('25 %');
    expect(fusingWords({ ...FACTS, place: 'coming', share: 1 }).now).toContain('100 %');
    expect(fusingWords({ ...FACTS, place: 'coming', share: 1, hasLibrary: false }).now).toContain('until the library');
    expect(fusingWords({ ...FACTS, problem: 'it broke' }).now).toBe('On the robot: it broke');
    expect(fusingWords({ ...FACTS, isPossible: false }).now).toContain('no library');
    expect(fusingWords(FACTS).now).toBe('On the robot.');
    expect(fusingWords({ ...FACTS, wish: 'here', unfit: 'map' }).now).toBe('On the robot, until its picture is complete.');
    expect(fusingWords({ ...FACTS, unfit: 'link' }).now).toContain('longer than');
    expect(fusingWords({ ...FACTS, unfit: 'map' }).now).toBe('On the robot, as long as the map grows.');
    expect(fusingWords({ ...FACTS, unfit: 'machine' }).now).toContain('small');
    expect(fusingWords({ ...FACTS, unfit: 'map', wish: 'robot' }).now).toBe('On the robot.');
    expect(fusingWords({ ...FACTS, wish: 'robot', isPossible: false }).now).toBe('On the robot.');
  });
});
