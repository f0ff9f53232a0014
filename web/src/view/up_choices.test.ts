import { describe, expect, it } from 'vitest';
import type { Bounds } from './first_view';
import { UpChoices } from './up_choices';

const bounds = (size: number): Bounds => ({ min: [0, 0, 0], max: [size, size, 3] });

function memory(text: string | null = null) {
  const storage = {
    text,
    getItem: () => storage.text,
    setItem: (_key: string, value: string) => {
      storage.text = value;
    },
  };
  return storage;
}

describe('UpChoices', () => {
  it('remembers a choice for a scene of one name and size, over pages', () => {
    const storage = memory();
    new UpChoices(storage).set('room', bounds(8), '-z');
    const next = new UpChoices(storage);
    expect(next.get('room', bounds(8.0001))).toBe('-z');
    expect(next.get('room', bounds(9))).toBeNull();
    expect(next.get('hall', bounds(8))).toBeNull();
    next.set('room', bounds(8), null);
    expect(new UpChoices(storage).get('room', bounds(8))).toBeNull();
  });

  it('forgets the oldest of very many', () => {
    const storage = memory();
    const choices = new UpChoices(storage);
    for (let i = 1; i <= 80; i += 1) choices.set(`scene ${i}`, bounds(i), 'z');
    expect(choices.get('scene 80', bounds(80))).toBe('z');
    expect(choices.get('scene 31', bounds(31))).toBe('z');
    expect(choices.get('scene 30', bounds(30))).toBeNull();
    expect(JSON.parse(storage.text ?? '[]')).toHaveLength(50);
  });

  it.each(['{', '7', '[["a"],["room 0 0 0 8 8 3","up"],null]', null])('takes %s in its place for nothing', (text) => {
    expect(new UpChoices(memory(text)).get('room', bounds(8))).toBeNull();
  });

  it('works without storage, and with one that refuses', () => {
    expect(new UpChoices(null).get('room', bounds(8))).toBeNull();
    const full = {
      getItem: () => null,
      setItem: () => {
        throw new Error('full');
      },
    };
    expect(() => new UpChoices(full).set('room', bounds(8), 'z')).not.toThrow();
  });
});
