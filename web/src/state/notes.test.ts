import { describe, expect, it } from 'vitest';
import type { Scene } from '../protocol/messages';
import { notesOf, strayCount } from './notes';

const scene = {
  name: 'room',
  notes: [
    { id: 'stray_points', count: 3, message: '3 stray vertices lie far from everything else.' },
    { id: 'kelvin', count: 1, message: 'The temperatures look like kelvin.' },
  ],
} as unknown as Scene;

describe('notesOf', () => {
  it('has what loading noticed and what the server says, errors first, each sentence once', () => {
    const notes = notesOf(scene, [
      { id: 'note.kelvin', level: 'warning', message: 'The temperatures look like kelvin.' },
      { id: 'load', level: 'error', message: 'The file cannot be read.' },
      { id: 'gone', level: 'info', message: null },
    ]);
    expect(notes.map(({ level, message }) => [level, message])).toEqual([
      ['error', 'The file cannot be read.'],
      ['warning', 'The temperatures look like kelvin.'],
      ['info', '3 stray vertices lie far from everything else.'],
    ]);
    expect(new Set(notes.map(({ key }) => key)).size).toBe(3);
  });

  it('has nothing where nothing is served', () => {
    expect(notesOf(undefined, [])).toEqual([]);
    expect(notesOf(null, [])).toEqual([]);
  });
});

describe('strayCount', () => {
  it('is what loading counted', () => {
    expect(strayCount(scene)).toBe(3);
    expect(strayCount({ ...scene, notes: [] })).toBe(0);
    expect(strayCount(null)).toBe(0);
  });
});
