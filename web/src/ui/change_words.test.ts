import { describe, expect, it } from 'vitest';
import type { Probe } from '../protocol/messages';
import { change, kelvin, localTime, probeWords } from './change_words';

const at = (hours: number, minutes: number, day = 14) => new Date(2026, 10, day, hours, minutes).getTime() / 1000;
const NOW = at(14, 31);
const PROBE: Probe = {
  vertex_index: 1,
  position: [0, 0, 0],
  temperature: 38.12,
  visible: [1, 2, 3],
  fused: [1, 2, 3],
  distance: 0,
  observed_at: NOW - 250,
  baseline: 35.84,
  baseline_at: at(14, 2),
};
const plain = (text: string) => text.replaceAll('\u202f', ' ');

describe('What a probe says', () => {
  it('is the temperature, how long ago, and by how much it has changed since when', () => {
    expect(plain(probeWords(PROBE, NOW))).toBe('38.1 °C, 4 min ago, +2.3 since 14:02');
    expect(plain(probeWords({ ...PROBE, baseline: 40 }, NOW))).toBe('38.1 °C, 4 min ago, \u22121.9 since 14:02');
    expect(plain(probeWords({ ...PROBE, baseline: 38.1 }, NOW))).toBe('38.1 °C, 4 min ago, 0.0 since 14:02');
  });

  it('is nothing of what is not known', () => {
    expect(plain(probeWords({ ...PROBE, observed_at: null }, NOW))).toBe('38.1 °C, +2.3 since 14:02');
    expect(plain(probeWords({ ...PROBE, baseline: null }, NOW))).toBe('38.1 °C, 4 min ago');
    expect(plain(probeWords({ ...PROBE, baseline_at: null }, NOW))).toBe('38.1 °C, 4 min ago');
    expect(plain(probeWords({ ...PROBE, temperature: null }, NOW))).toBe('no temperature, 4 min ago');
    expect(plain(probeWords({ ...PROBE, temperature: null, temperature_range: 'over' }, NOW))).toBe('over range, 4 min ago');
    const { observed_at, baseline, baseline_at, ...old } = PROBE;
    expect([observed_at, baseline, baseline_at].every((value) => value != null)).toBe(true);
    expect(plain(probeWords(old, NOW))).toBe('38.1 °C');
  });

  it('is as old as the last look with the thermal camera, and as sure', () => {
    const sure = { ...PROBE, baseline: null, temperature_sigma: 0.3, temperature_at: NOW - 12 };
    expect(plain(probeWords(sure, NOW))).toBe('38.1 ± 0.3 °C, 12 s ago');
  });

  it('is no change of what was seen for the first time', () => {
    expect(plain(probeWords({ ...PROBE, baseline: 38.12, baseline_at: NOW - 250 }, NOW))).toBe('38.1 °C, 4 min ago');
  });

  it('has the day where it is another', () => {
    expect(localTime(at(23, 5, 13), NOW)).toBe('13 Nov 23:05');
  });

  it('is of a moment to come seen just now', () => {
    expect(plain(probeWords({ ...PROBE, observed_at: NOW + 5, baseline: null }, NOW))).toBe('38.1 °C, 0 s ago');
  });
});

describe('A change', () => {
  it('has its sign, and none where it rounds to nothing', () => {
    expect([2.34, -2.34, 0.04, -0.04].map((value) => change(value))).toEqual(['+2.3', '\u22122.3', '0.0', '0.0']);
    expect(plain(kelvin(5))).toBe('+5.0 K');
  });
});
