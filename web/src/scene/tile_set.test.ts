import { beforeEach, describe, expect, it } from 'vitest';
import type { DecodedGeometry } from '../decode/messages';
import { childTile, type TileFrame, type TileId, tileKey } from '../protocol/frame';
import { type Drawable, TileSet } from './tile_set';

const root: TileId = { level: 0, x: 0, y: 0, z: 0 };

function geometry(vertices = 3): DecodedGeometry {
  return {
    kind: 'geometry',
    positions: new Float32Array(vertices * 3),
    indices: Uint16Array.from([0, 1, 2]),
    centre: [0, 0, 0],
    radius: 1,
    bounds: { min: [0, 0, 0], max: [1, 1, 1] },
    normal_sum: [0, 0, 1],
    area_sum: 1,
  };
}

function frame(tile: TileId, part: Partial<TileFrame> = {}): TileFrame {
  return {
    kind: 2,
    child_mask: 0,
    sequence: 1,
    generation: 1,
    tile,
    revision: 1,
    vertex_count: 3,
    origin_m: [0, 0, 0],
    position_step_m: 1,
    geometric_error_m: 0,
    lowest_celsius: 0,
    highest_celsius: 0,
    payload: new Uint8Array(0),
    ...part,
  };
}
const colours = (shade: number, vertices = 3) => new Uint8Array(vertices * 4).fill(shade);

class FakeDrawable implements Drawable {
  visible = false;
  disposed = false;
  constructor(public shade: number) {}
  setColours(rgba: Uint8Array): void {
    this.shade = rgba[0] ?? -1;
  }
  setVisible(visible: boolean): void {
    this.visible = visible;
  }
  dispose(): void {
    this.disposed = true;
  }
}

let made: FakeDrawable[];
let tiles: TileSet;
beforeEach(() => {
  made = [];
  tiles = new TileSet((_geometry, rgba) => {
    const drawable = new FakeDrawable(rgba[0] ?? -1);
    made.push(drawable);
    return drawable;
  });
});

function add(tile: TileId, part: Partial<TileFrame> = {}, shade = 1): FakeDrawable {
  tiles.addGeometry(frame(tile, part), geometry());
  tiles.addColours(frame(tile, part), colours(shade));
  tiles.updateSelection();
  return made.at(-1) as FakeDrawable;
}
const drawn = () => made.filter(({ visible, disposed }) => visible && !disposed).length;

describe('TileSet', () => {
  it('draws a tile once it has geometry and colours, in either order', () => {
    tiles.addColours(frame(root), colours(5));
    tiles.updateSelection();
    expect(made).toHaveLength(0);
    tiles.addGeometry(frame(root), geometry());
    tiles.updateSelection();
    expect(drawn()).toBe(1);
    expect(tiles.counts()).toEqual({ tiles: 1, vertices: 3, triangles: 1 });
  });

  it('never goes back to colours of an older generation', () => {
    const drawable = add(root, { generation: 7 }, 70);
    tiles.addColours(frame(root, { generation: 6 }), colours(60));
    expect(drawable.shade).toBe(70);
    tiles.addColours(frame(root, { generation: 8 }), colours(80));
    expect(drawable.shade).toBe(80);
  });

  it('keeps the newest of colours that wait for their geometry', () => {
    tiles.addColours(frame(root, { generation: 9 }), colours(90));
    tiles.addColours(frame(root, { generation: 8 }), colours(80));
    tiles.addGeometry(frame(root), geometry());
    expect(made[0]?.shade).toBe(90);
  });

  it('keeps the old geometry on the screen until the new one has its colours', () => {
    const old = add(root);
    tiles.addGeometry(frame(root, { revision: 2 }), geometry(4));
    tiles.updateSelection();
    expect(old.disposed).toBe(false);
    tiles.addColours(frame(root, { revision: 2, generation: 2 }), colours(9, 4));
    tiles.updateSelection();
    expect(old.disposed).toBe(true);
    expect(tiles.counts().vertices).toBe(4);
  });

  it('refuses colours of another number of vertices', () => {
    add(root);
    expect(() => tiles.addColours(frame(root, { generation: 2 }), colours(1, 5))).toThrow('colours of 5 vertices');
  });

  it('replaces a parent only when all its children can be drawn', () => {
    const parent = add(root, { child_mask: 0b1001 });
    const first = add(childTile(root, 0));
    expect([parent.visible, first.visible]).toEqual([true, false]);
    const second = add(childTile(root, 3));
    expect([parent.visible, first.visible, second.visible]).toEqual([false, true, true]);
    tiles.remove(childTile(root, 3));
    tiles.updateSelection();
    expect([parent.visible, first.visible, second.disposed]).toEqual([true, false, true]);
  });

  it('lets grandchildren stand for a child that is not there', () => {
    const parent = add(root, { child_mask: 0b1 });
    const child = childTile(root, 0);
    tiles.addGeometry(frame(child, { child_mask: 0b10 }), geometry());
    const grandchild = add(childTile(child, 1));
    expect([parent.visible, grandchild.visible]).toEqual([false, true]);
  });

  it('draws leaves whose ancestors were never sent', () => {
    const leaf = add({ level: 3, x: 1, y: 2, z: 3 });
    const other = add({ level: 3, x: 7, y: 2, z: 3 });
    expect([leaf.visible, other.visible]).toEqual([true, true]);
  });

  it('keeps the picture through a new connection and then drops what was not sent again', () => {
    const a = { level: 1, x: 0, y: 0, z: 0 };
    const b = { level: 1, x: 1, y: 0, z: 0 };
    const oldA = add(a, { revision: 5, generation: 40 });
    const oldB = add(b, { revision: 5, generation: 40 });
    tiles.beginConnection();
    tiles.updateSelection();
    expect([oldA.visible, oldB.visible]).toEqual([true, true]);
    const newA = add(a, { revision: 1, generation: 2 }, 99);
    expect([oldA.disposed, newA.shade, oldB.visible]).toEqual([true, 99, true]);
    tiles.endStale();
    tiles.updateSelection();
    expect(oldB.disposed).toBe(true);
    expect(drawn()).toBe(1);
  });

  it('does not colour geometry of an earlier connection', () => {
    const old = add(root, { generation: 3 }, 30);
    tiles.beginConnection();
    tiles.addColours(frame(root, { generation: 4 }), colours(40));
    expect(old.shade).toBe(30);
  });

  it('disposes of everything it made', () => {
    for (let i = 0; i < 8; i += 1) add(childTile(root, i));
    tiles.clear();
    expect(made.every(({ disposed }) => disposed)).toBe(true);
    expect(tiles.size).toBe(0);
  });

  it('tells how far a generation has come', () => {
    add(childTile(root, 0), { generation: 1 });
    add(childTile(root, 1), { generation: 2 });
    expect(tiles.progress(2)).toEqual({ current: 1, total: 2 });
  });

  it('gives every tile its own name', () => {
    const names = new Set([0, 1, 2, 3].flatMap((x) => [0, 1].map((y) => tileKey({ level: 2, x, y, z: 0 }))));
    expect(names.size).toBe(8);
  });
});
