import { beforeEach, describe, expect, it } from 'vitest';
import type { DecodedColours } from '../decode/messages';
import { childTile, type TileFrame, type TileId } from '../protocol/frame';
import { Arrivals, LONGEST_WAIT_MS } from './arrivals';
import { decodedGeometry, ROOT as root, tileFrame } from './test_tiles';
import { TileSet } from './tile_set';

const left = childTile(root, 0);
const right = childTile(root, 1);
const PLENTY = 1e9;

const colours: DecodedColours = { kind: 'colours', rgba: new Uint8Array(4) };

let sequence: number;
let tiles: TileSet;
let arrivals: Arrivals;
let problems: unknown[];
let now: number;

function frame(tile: TileId, generation: number): TileFrame {
  sequence += 1;
  return tileFrame(tile, { child_mask: tile.level === 0 ? 0b11 : 0, sequence, generation });
}
const arrive = (tile: TileId, generation: number) => arrivals.add(frame(tile, generation), colours, now);
/** One picture: 'coarse' when the root alone is drawn. */
function picture(budget = PLENTY, isLast = false): { shows: 'coarse' | 'fine'; next_ms: number | null } {
  const { next_ms } = arrivals.bringIn(now, budget, isLast);
  tiles.updateSelection();
  return { shows: tiles.counts().tiles === 1 ? 'coarse' : 'fine', next_ms };
}

beforeEach(() => {
  sequence = 0;
  now = 1000;
  problems = [];
  tiles = new TileSet(() => ({
    setColours: () => undefined,
    setRaw: () => undefined,
    setSigma: () => undefined,
    setVisible: () => undefined,
    dispose: () => undefined,
  }));
  arrivals = new Arrivals(tiles, (error) => problems.push(error));
  for (const tile of [root, left, right]) {
    arrivals.add(frame(tile, 1), decodedGeometry(), now);
    arrive(tile, 1);
  }
  expect(picture()).toEqual({ shows: 'fine', next_ms: null });
});

describe('Arrivals', () => {
  it('does not let the parent flash when its children are there in the same picture', () => {
    for (const tile of [root, left, right]) arrive(tile, 2);
    expect(picture()).toEqual({ shows: 'fine', next_ms: null });
    expect(tiles.progress(2)).toEqual({ current: 2, total: 2 });
    expect(arrivals.size).toBe(0);
  });

  it('lets the parent wait for children that do not fit into this picture', () => {
    for (const tile of [root, left, right]) arrive(tile, 2);
    expect(picture(4)).toEqual({ shows: 'fine', next_ms: 0 });
    expect(picture(4)).toEqual({ shows: 'fine', next_ms: 0 });
    expect(picture(4)).toEqual({ shows: 'fine', next_ms: null });
  });

  it('shows the coarse answer after a short wait, and then without one until detail is quick again', () => {
    arrive(root, 2);
    expect(picture()).toEqual({ shows: 'fine', next_ms: LONGEST_WAIT_MS });
    now += 30;
    arrive(left, 2);
    expect(picture()).toEqual({ shows: 'fine', next_ms: LONGEST_WAIT_MS - 30 });
    now += LONGEST_WAIT_MS - 30;
    expect(picture()).toEqual({ shows: 'coarse', next_ms: null });
    now += 200;
    arrive(right, 2);
    expect(picture().shows).toBe('fine');

    arrive(root, 3);
    expect(picture()).toEqual({ shows: 'coarse', next_ms: null });
    now += 20;
    arrive(left, 3);
    arrive(right, 3);
    expect(picture().shows).toBe('fine');

    arrive(root, 4);
    expect(picture().shows).toBe('fine');
  });

  it('judges how quick detail is by the newest answer', () => {
    arrive(root, 2);
    now += LONGEST_WAIT_MS;
    expect(picture().shows).toBe('coarse');
    for (let generation = 3; generation < 10; generation += 1) {
      now += 50;
      arrive(root, generation);
      expect(picture().shows).toBe('coarse');
    }
    now += 40;
    arrive(left, 9);
    arrive(right, 9);
    expect(picture().shows).toBe('fine');
    arrive(root, 10);
    expect(picture().shows).toBe('fine');
  });

  it('does not start waiting anew with every generation', () => {
    for (let generation = 2; generation < 7; generation += 1) {
      arrive(root, generation);
      expect(picture().shows).toBe(generation < 6 ? 'fine' : 'coarse');
      now += LONGEST_WAIT_MS / 4;
    }
  });

  it('does not wait when nothing follows', () => {
    arrive(root, 2);
    expect(picture(PLENTY, true)).toEqual({ shows: 'coarse', next_ms: null });
  });

  it('keeps the newest per tile and kind, and nothing of tiles that are gone', () => {
    const older = frame(left, 2);
    arrive(left, 3);
    arrivals.add(older, colours, now);
    arrive(right, 3);
    expect(arrivals.size).toBe(2);
    arrivals.drop(right);
    picture();
    expect(tiles.progress(3)).toEqual({ current: 1, total: 2 });
    arrive(right, 3);
    arrivals.clear();
    expect(arrivals.size).toBe(0);
  });

  it('says what does not fit and goes on', () => {
    arrivals.add(frame(left, 2), { kind: 'colours', rgba: new Uint8Array(8) }, now);
    arrive(right, 2);
    picture();
    expect(problems).toHaveLength(1);
    expect(tiles.progress(2)).toEqual({ current: 1, total: 2 });
  });
});
