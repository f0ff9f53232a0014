import { describe, expect, it } from 'vitest';
import type { Fusion, Method } from '../protocol/messages';
import { mixesPalette } from './mixing';

const method = { id: 'of_this_test', uses_palette: true, params: [{ name: 'alpha' }] } as unknown as Method;
const set = (params: Fusion['params'], more: Partial<Fusion> = {}) => ({ params, ...more }) as Fusion;

describe('Colours of the palette in the picture', () => {
  it('are mixed unless their weight is one', () => {
    expect(mixesPalette(method, set({ alpha: 0.85 }))).toBe(true);
    expect(mixesPalette(method, set({ alpha: 1 }))).toBe(false);
    expect(mixesPalette(method, set({ alpha: 1 }, { params_in_force: { alpha: 0.5 } }))).toBe(true);
  });

  it('are mixed by a method whose formula has no such weight', () => {
    expect(mixesPalette({ ...method, params: [] }, set({ k: 1 }))).toBe(true);
  });

  it('are mixed where what is old fades', () => {
    expect(mixesPalette(method, set({ alpha: 1 }, { age: { mode: 'fade', half_life_s: 60 } }))).toBe(true);
  });

  it('are not there at all without a palette', () => {
    expect(mixesPalette({ ...method, uses_palette: false }, set({ alpha: 0.5 }))).toBe(false);
    expect(mixesPalette(null, set({}))).toBe(false);
  });
});
