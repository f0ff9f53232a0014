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

  it('says the same note again by the same key, whatever it counts by then', () => {
    const keys = (count: number) =>
      notesOf(
        {
          ...scene,
          notes: [
            { id: 'no_temperature', count, message: `block 1_1: ${count} vertices without a temperature` },
            { id: 'no_temperature', count, message: `block 1_2: ${count} vertices without a temperature` },
          ],
        } as unknown as Scene,
        [{ id: 'map', level: 'warning', message: `${count} frames were late.` }],
      ).map(({ key }) => key);
    expect(keys(1446)).toEqual(keys(1279));
    expect(new Set(keys(1446)).size).toBe(3);
  });

  it('says what comes as a note of the scene and as a status once, by the newer words of the status', () => {
    const growing = {
      ...scene,
      notes: [{ id: 'no_temperature', count: 3, message: 'block 1: 3 vertices without a temperature' }],
    } as unknown as Scene;
    const status = {
      id: 'scene.no_temperature',
      level: 'warning',
      message: 'block 1: 5 vertices without a temperature',
    } as const;
    const notes = notesOf(growing, [status]);
    expect(notes.map(({ message }) => message)).toEqual([status.message]);
    expect(notes[0]?.key).toBe(notesOf(growing, [])[0]?.key);
  });

  it('takes an error with other words for another one', () => {
    const key = (message: string) => notesOf(null, [{ id: 'load', level: 'error', message }])[0]?.key;
    expect(key('a.ply cannot be read.')).not.toBe(key('b.ply cannot be read.'));
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
