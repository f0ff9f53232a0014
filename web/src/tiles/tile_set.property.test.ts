import { describe, expect, it } from 'vitest';
import { childTile, parentTile, type TileFrame, type TileId, tileKey } from '../protocol/frame';
import { decodedGeometry, tileFrame } from './test_tiles';
import { type Drawable, TileSet } from './tile_set';

/** mulberry32: the same numbers in every run. */
function randomNumbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

interface SceneTile {
  id: TileId;
  key: string;
  mask: number;
  children: SceneTile[];
}

/** A tree of up to five levels, with one to eight children where there are any. */
function randomTree(random: () => number): SceneTile[] {
  const all: SceneTile[] = [];
  const grow = (id: TileId): SceneTile => {
    const tile: SceneTile = { id, key: tileKey(id), mask: 0, children: [] };
    all.push(tile);
    if (id.level < 4 && (id.level === 0 || random() < 0.45)) {
      tile.mask = 1 + Math.floor(random() * 255);
      for (let octant = 0; octant < 8; octant += 1) {
        if (tile.mask & (1 << octant) && all.length < 200) tile.children.push(grow(childTile(id, octant)));
        else tile.mask &= ~(1 << octant);
      }
    }
    return tile;
  };
  grow({ level: 0, x: 0, y: 0, z: 0 });
  return all;
}

/** What a tile shows: connection * 1000 + generation. */
type Held = Map<string, number>;

class Picture {
  readonly drawables = new Map<string, Drawable & { visible: boolean }>();
  readonly tiles: TileSet;
  /** The tile that is being added: a drawable is not told which one it is of. */
  adding = '';

  constructor() {
    this.tiles = new TileSet(() => {
      const key = this.adding;
      const drawable = {
        visible: false,
        setColours: () => undefined,
        setRaw: () => undefined,
        setSigma: () => undefined,
        setVisible: (visible: boolean) => {
          drawable.visible = visible;
        },
        dispose: () => {
          if (this.drawables.get(key) === drawable) this.drawables.delete(key);
        },
      };
      this.drawables.set(key, drawable);
      return drawable;
    });
  }

  get drawn(): Set<string> {
    return new Set([...this.drawables].filter(([, { visible }]) => visible).map(([key]) => key));
  }
}

function frameOf(tile: SceneTile, generation: number, revision: number): TileFrame {
  return tileFrame(tile.id, { child_mask: tile.mask, generation, revision });
}

function shuffled<T>(items: readonly T[], random: () => number): T[] {
  const result = [...items];
  for (let i = result.length - 1; i > 0; i -= 1) {
    const j = Math.floor(random() * (i + 1));
    [result[i], result[j]] = [result[j]!, result[i]!];
  }
  return result;
}

/**
 * What is wrong with a picture; null when nothing is: no drawn tile has older colours than any tile above it, nothing is drawn twice,
 * and what can be drawn is. An `expect` for each pair of tiles would take most of the time of these tests.
 */
function flawIn(scene: readonly SceneTile[], held: Held, drawn: Set<string>): string | null {
  for (const { id, key } of scene) {
    if (!drawn.has(key)) continue;
    for (let above = parentTile(id); above !== null; above = parentTile(above)) {
      const aboveKey = tileKey(above);
      if (drawn.has(aboveKey)) return `${key} and ${aboveKey} above it are both drawn`;
      if ((held.get(key) ?? -2) < (held.get(aboveKey) ?? -1)) return `${key} hides newer colours of ${aboveKey}`;
    }
  }
  const isFilled = (tile: SceneTile): boolean =>
    drawn.has(tile.key) || (tile.children.length > 0 && tile.children.every(isFilled));
  const emptyIn = (tile: SceneTile): SceneTile | undefined => {
    if (held.has(tile.key)) return isFilled(tile) ? undefined : tile;
    for (const child of tile.children) {
      const empty = emptyIn(child);
      if (empty !== undefined) return empty;
    }
    return undefined;
  };
  const empty = emptyIn(scene[0]!);
  return empty === undefined ? null : `nothing stands for ${empty.key}`;
}

function isSame(a: Set<string>, b: Set<string>): boolean {
  return a.size === b.size && [...a].every((key) => b.has(key));
}

/** The rule in its plainest form. */
function expectedPicture(scene: readonly SceneTile[], held: Held): Set<string> {
  const cover = (tile: SceneTile): number =>
    tile.children.length === 0 || !held.has(tile.key) ? -Infinity : Math.min(...tile.children.map(best));
  const best = (tile: SceneTile): number => Math.max(held.get(tile.key) ?? -Infinity, cover(tile));
  const drawn = new Set<string>();
  const visit = (tile: SceneTile): void => {
    const own = held.get(tile.key) ?? -Infinity;
    if (own > cover(tile)) drawn.add(tile.key);
    else tile.children.forEach(visit);
  };
  visit(scene[0]!);
  return drawn;
}

/** Each takes well under a second on an idle machine; a busy one may take its time. */
const LIMIT_MS = 60_000;

describe('TileSet, with random trees and arrivals', { timeout: LIMIT_MS }, () => {
  it('never draws older colours in front of newer ones, leaves no hole and draws nothing twice', () => {
    for (let seed = 1; seed <= 80; seed += 1) {
      const random = randomNumbers(seed);
      const scene = randomTree(random);
      const picture = new Picture();
      const held: Held = new Map();
      const geometries = new Map<string, number>();
      let connection = 0;
      let generation = 1;
      for (let step = 0; step < 250; step += 1) {
        const tile = scene[Math.floor(random() ** 1.5 * scene.length)]!;
        const chance = random();
        if (chance < 0.02) {
          connection += 1;
          generation = 1;
          geometries.clear();
          picture.tiles.beginConnection();
        } else if (chance < 0.04 && connection > 0) {
          picture.tiles.settle();
          for (const [key, rank] of held) if (rank < connection * 1000) held.delete(key);
        } else if (chance < 0.08) {
          picture.tiles.remove(tile.id);
          held.delete(tile.key);
          geometries.delete(tile.key);
        } else if (chance < 0.2) {
          generation += 1;
        } else {
          const revision = random() < 0.9 ? (geometries.get(tile.key) ?? 1) : (geometries.get(tile.key) ?? 1) + 1;
          const shown = Math.max(1, generation - Math.floor(random() * 3));
          const frame = frameOf(tile, shown, revision);
          picture.adding = tile.key;
          const parts = [() => picture.tiles.addColours(frame, new Uint8Array(4))];
          const isNew = geometries.get(tile.key) !== revision;
          if (isNew) parts.splice(random() < 0.5 ? 0 : 1, 0, () => picture.tiles.addGeometry(frame, decodedGeometry()));
          for (const part of parts) part();
          geometries.set(tile.key, revision);
          const rank = connection * 1000 + shown;
          held.set(tile.key, isNew ? rank : Math.max(held.get(tile.key) ?? -1, rank));
        }
        if (random() < 0.7) {
          picture.tiles.updateSelection();
          expect(flawIn(scene, held, picture.drawn), `seed ${seed}, step ${step}`).toBeNull();
        }
      }
      picture.tiles.updateSelection();
      expect(picture.drawn).toEqual(expectedPicture(scene, held));
      picture.tiles.clear();
      expect(picture.drawables.size).toBe(0);
    }
  });

  it('draws the finest cover once all of it has the newest colours, and not before', () => {
    for (let seed = 1; seed <= 40; seed += 1) {
      const random = randomNumbers(seed);
      const scene = randomTree(random);
      const picture = new Picture();
      const held: Held = new Map();
      const add = (tile: SceneTile, generation: number) => {
        const frame = frameOf(tile, generation, 1);
        picture.adding = tile.key;
        if (!held.has(tile.key)) picture.tiles.addGeometry(frame, decodedGeometry());
        picture.tiles.addColours(frame, new Uint8Array(4));
        held.set(tile.key, generation);
      };
      for (const tile of shuffled(scene, random)) add(tile, 1);
      picture.tiles.updateSelection();
      const leaves = scene.filter(({ children }) => children.length === 0);
      const finest = new Set(leaves.map(({ key }) => key));
      expect(picture.drawn).toEqual(finest);
      for (let generation = 2; generation <= 4; generation += 1) {
        const previews = scene.filter(({ id, children }) => children.length > 0 && (id.level === 0 || random() < 0.3));
        for (const tile of shuffled(previews, random)) add(tile, generation);
        const order = shuffled(leaves, random);
        order.forEach((tile, index) => {
          picture.tiles.updateSelection();
          expect(isSame(picture.drawn, finest)).toBe(false);
          const { current, total } = picture.tiles.progress(generation);
          expect([current, total]).toEqual([index, leaves.length]);
          add(tile, generation);
          picture.tiles.updateSelection();
          expect(flawIn(scene, held, picture.drawn), `seed ${seed}, generation ${generation}`).toBeNull();
        });
        expect(picture.drawn).toEqual(finest);
        expect(picture.tiles.progress(generation)).toEqual({ current: leaves.length, total: leaves.length });
      }
    }
  });
});
