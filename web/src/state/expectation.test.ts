import { describe, expect, it } from 'vitest';
import { Expectation } from './expectation';

type What = ConstructorParameters<typeof Expectation>[0];

describe('Expectation', () => {
  const quiet = {
    settled: true,
    fusingPlace: 'robot',
    hatchAbove_kelvin: null,
    methods: [{}],
    server: { capabilities: ['temperature_sigma'] },
  } as unknown as What;
  const isMuch = (change: Partial<What>, lacking = 0) =>
    new Expectation({ ...quiet, ...change }, { lackingSigma: () => lacking }).isMuch();

  it.each([
    ['the picture', { settled: false }],
    ['raw layers', { fusingPlace: 'coming' }],
    ['methods', { methods: [] }],
  ])('is of much while %s are on their way', (_what, change) => {
    expect(isMuch(change as Partial<What>)).toBe(true);
    expect(isMuch({})).toBe(false);
  });

  it('is so with a hatch limit only while something that is drawn lacks how sure its temperatures are', () => {
    expect(isMuch({ hatchAbove_kelvin: 0.5 }, 1)).toBe(true);
    expect(isMuch({ hatchAbove_kelvin: 0.5 }, 0)).toBe(false);
    expect(isMuch({}, 1)).toBe(false);
    expect(isMuch({ hatchAbove_kelvin: 0.5, server: { capabilities: [] } as never }, 1)).toBe(false);
  });

  it('gives up what does not come, until something does', () => {
    let now = 100_000;
    let lacking = 3;
    const expectation = new Expectation({ ...quiet, hatchAbove_kelvin: 0.5 }, { lackingSigma: () => lacking }, () => now);
    expect(expectation.isMuch()).toBe(true);
    now += 29_000;
    lacking = 2;
    expect(expectation.isMuch()).toBe(true);
    now += 29_000;
    expect(expectation.isMuch()).toBe(true);
    now += 2_000;
    expect(expectation.isMuch()).toBe(false);
    lacking = 1;
    expect(expectation.isMuch()).toBe(true);
  });
});
