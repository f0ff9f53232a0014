import { describe, expect, it } from 'vitest';
import { MapAge } from './map_age';

describe('the age of a map', () => {
  it('counts from when its newest part was seen', () => {
    const age = new MapAge();
    expect(age.at(1000)).toBeNull();
    age.newestIs(999.6, 1000);
    expect(age.at(1000)).toBeCloseTo(0.4);
    expect(age.at(1240)).toBeCloseTo(240.4);
    age.newestIs(1239, 1240);
    expect(age.at(1240)).toBeCloseTo(1);
    age.newestIs(null, 1241);
    expect(age.at(1241)).toBeNull();
  });

  it('goes on on a machine whose clock is behind', () => {
    const age = new MapAge();
    age.newestIs(1030, 1000);
    expect(age.at(1000)).toBe(0);
    expect(age.at(1005)).toBe(5);
    // By now it is known how far.
    age.newestIs(1033, 1005);
    expect(age.at(1005)).toBe(2);
  });

  it('forgets a time that was wrong, when the map takes it back', () => {
    const age = new MapAge();
    age.newestIs(990, 1000);
    age.newestIs(1.7e12, 1001);
    expect(age.at(1002)).toBeCloseTo(1);
    age.newestIs(1000, 1003);
    expect(age.at(1003)).toBe(3);
    age.newestIs(1.7e12, 1004);
    age.newestIs(null, 1005);
    age.newestIs(1004, 1006);
    expect(age.at(1006)).toBe(2);
  });
});
