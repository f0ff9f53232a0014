import { expect, test } from 'vitest';
import { sigmaStep, UNKNOWN_SIGMA } from './sigma_steps';

test('what is surer has a smaller step, within 3 % of a kelvin value, and the unknown the largest', () => {
  let before = -1;
  for (let kelvin = 0.011; kelvin < 14; kelvin *= 1.06) {
    const step = sigmaStep(kelvin);
    expect(step).toBeGreaterThan(before);
    before = step;
  }
  expect(before).toBeLessThan(UNKNOWN_SIGMA);
  expect([sigmaStep(0), sigmaStep(0.001), sigmaStep(0.01)]).toEqual([0, 0, 0]);
  expect(sigmaStep(1e6)).toBe(UNKNOWN_SIGMA - 1);
  expect(sigmaStep(Infinity)).toBe(UNKNOWN_SIGMA - 1);
  expect(sigmaStep(Number.NaN)).toBe(UNKNOWN_SIGMA);
});
