import { beforeEach, describe, expect, it } from 'vitest';
import type { DecodedSigma } from '../decode/messages';
import { childTile, type TileFrame, type TileId, tileKey } from '../protocol/frame';
import { decodedGeometry, ROOT as root, tileFrame as frame } from './test_tiles';
import { CLAIM_VALUES, type Drawable, TileSet, RawMismatch, type RawLayers, type TileClaim } from './tile_set';

const geometry = (vertices = 3) => decodedGeometry(vertices);
const colours = (shade: number, vertices = 3) => new Uint8Array(vertices * 4).fill(shade);

class FakeDrawable implements Drawable {
  visible = false;
  disposed = false;
  raw: Partial<RawLayers> | null = null;
  constructor(public shade: number) {}
  setColours(rgba: Uint8Array): void {
    this.shade = rgba[0] ?? -1;
  }
  setRaw(raw: Partial<RawLayers>): void {
    this.raw = { ...this.raw, ...raw };
  }
  sigma: number[] | null = null;
  setSigma({ codes }: DecodedSigma): void {
    this.sigma = [...codes];
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
let masks: Map<string, number>;
beforeEach(() => {
  made = [];
  masks = new Map();
  tiles = new TileSet((_geometry, rgba) => {
    const drawable = new FakeDrawable(rgba[0] ?? -1);
    made.push(drawable);
    return drawable;
  });
});

function add(tile: TileId, part: Partial<TileFrame> = {}, shade = 1): FakeDrawable {
  if (part.child_mask !== undefined) masks.set(tileKey(tile), part.child_mask);
  tiles.addGeometry(frame(tile, part), geometry());
  tiles.addColours(frame(tile, part), colours(shade));
  tiles.updateSelection();
  return made.at(-1) as FakeDrawable;
}
function recolour(tile: TileId, generation: number, revision = 1): void {
  tiles.addColours(frame(tile, { generation, revision, child_mask: masks.get(tileKey(tile)) ?? 0 }), colours(generation));
  tiles.updateSelection();
}
/** The server's answer to claims; `places` of those whose colours it says are those of `generation`. */
function resume(claims: TileClaim[], isGranted: boolean, places: number[] = [], generation = 1): void {
  tiles.resume(claims, isGranted, tiles.layersOf(claims), { places, generation });
}
const drawn = () => made.filter(({ visible, disposed }) => visible && !disposed).length;

describe('TileSet, of a scene that changes by itself', () => {
  const children = [0, 1].map((octant) => childTile(root, octant));

  function fine(): FakeDrawable[] {
    const [top, ...details] = [
      add(root, { child_mask: 3, generation: 4 }, 4),
      ...children.map((child) => add(child, { generation: 4 }, 4)),
    ];
    expect([top!, ...details].map(({ visible }) => visible)).toEqual([false, true, true]);
    return [top!, ...details];
  }

  it('leaves the children that are there until the tile that names others can be drawn', () => {
    const [, one, other] = fine();
    const visible = () => [one!, other!].map((tile) => tile.visible);
    const leaf = { revision: 2, generation: 4, child_mask: 0 };
    // It is to be a leaf.
    tiles.addGeometry(frame(root, leaf), geometry());
    tiles.updateSelection();
    expect(visible()).toEqual([true, true]);
    tiles.addColours(frame(root, leaf), colours(4));
    tiles.updateSelection();
    expect([...visible(), made.at(-1)!.visible]).toEqual([false, false, true]);
  });

  it('goes by the newest mask where a child of the one before is gone', () => {
    const [, one] = fine();
    tiles.addGeometry(frame(root, { revision: 2, generation: 4, child_mask: 1 }), geometry());
    tiles.remove(children[1]!);
    tiles.updateSelection();
    expect([one!.visible, drawn()]).toEqual([true, 1]);
  });

  it('leaves detail where it is until its own successor has come', () => {
    const [top, one, other] = fine();
    tiles.isVersion(5);
    recolour(root, 5);
    expect(tiles.wouldHideDetail(frame(root, { generation: 5 }))).toBe(false);
    expect([top, one, other].map((tile) => tile!.visible)).toEqual([false, true, true]);
    // The one that has changed is made anew; all the while something is drawn at its place.
    tiles.addGeometry(frame(children[0]!, { generation: 5, revision: 2 }), geometry());
    tiles.updateSelection();
    expect(drawn()).toBe(2);
    tiles.addColours(frame(children[0]!, { generation: 5, revision: 2 }), colours(5));
    tiles.updateSelection();
    expect(drawn()).toBe(2);
    expect(one!.disposed).toBe(true);
    expect(made.at(-1)).toMatchObject({ shade: 5, visible: true });
    recolour(children[1]!, 5);
    expect(other).toMatchObject({ shade: 5, visible: true });
    expect(top!.visible).toBe(false);
  });

  it('does so through any number of versions, and still shows at once what was asked for', () => {
    const [top, one] = fine();
    for (let generation = 5; generation < 500; generation += 1) {
      tiles.isVersion(generation);
      recolour(root, generation);
      expect([top!.visible, one!.visible]).toEqual([false, true]);
    }
    // Asked for: no old detail stands in front of it.
    recolour(root, 500);
    expect([top!.visible, one!.visible]).toEqual([true, false]);
    // The next version of that, with detail still from before.
    tiles.isVersion(501);
    recolour(children[0]!, 501);
    expect([top!.visible, one!.visible]).toEqual([true, false]);
    recolour(children[1]!, 501);
    expect([top!.visible, one!.visible]).toEqual([false, true]);
  });

  it('counts generations anew on a new connection', () => {
    const [top, one] = fine();
    tiles.isVersion(5);
    tiles.beginConnection();
    resume(tiles.claims(100), true);
    recolour(root, 5);
    expect([top!.visible, one!.visible]).toEqual([true, false]);
  });
});

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

  it('takes how sure temperatures are with the geometry of its revision, whichever comes first', () => {
    const sigma = (...codes: number[]): DecodedSigma => ({ kind: 'sigma', codes: Uint16Array.from(codes), scale: 1, offset: 0 });
    tiles.addSigma(frame(root), sigma(1, 2, 3));
    expect(add(root).sigma).toEqual([1, 2, 3]);
    // Of another revision, or of another length, it is of something else.
    tiles.addSigma(frame(root, { revision: 2 }), sigma(4, 5, 6));
    const next = add(root, { revision: 2, generation: 2 });
    expect(next.sigma).toEqual([4, 5, 6]);
    tiles.addSigma(frame(root, { revision: 1 }), sigma(7, 8, 9));
    tiles.addSigma(frame(root, { revision: 2 }), sigma(7));
    expect(next.sigma).toEqual([4, 5, 6]);
  });

  it('counts what is drawn and lacks how sure its temperatures are', () => {
    const sigma: DecodedSigma = { kind: 'sigma', codes: Uint16Array.of(1, 2, 3), scale: 1, offset: 0 };
    expect(tiles.lackingSigma()).toBe(0);
    add(root, { child_mask: 0b1 });
    expect(tiles.lackingSigma()).toBe(1);
    add(childTile(root, 0));
    tiles.addSigma(frame(childTile(root, 0)), sigma);
    // The top is not drawn.
    expect(tiles.lackingSigma()).toBe(0);
    add(childTile(root, 0), { revision: 2, generation: 2 });
    expect(tiles.lackingSigma()).toBe(1);
  });

  it('leaves out the finest levels while the camera moves, where nothing newer is lost by it', () => {
    const coarse = add(root, { child_mask: 3 });
    const fine = [childTile(root, 0), childTile(root, 1)].map((id) => add(id));
    expect([coarse, ...fine].map(({ visible }) => visible)).toEqual([false, true, true]);
    tiles.leaveOut(1);
    tiles.updateSelection();
    expect([coarse, ...fine].map(({ visible }) => visible)).toEqual([true, false, false]);
    // What is complete is counted by all detail, and one newer child is not hidden by its older parent.
    tiles.settle();
    expect(tiles.progress(1)).toEqual({ current: 2, total: 2 });
    recolour(childTile(root, 0), 2);
    expect([coarse, ...fine].map(({ visible }) => visible)).toEqual([false, true, true]);
    recolour(root, 2);
    expect(coarse.visible).toBe(true);
    tiles.leaveOut(0);
    recolour(childTile(root, 1), 2);
    expect([coarse, ...fine].map(({ visible }) => visible)).toEqual([false, true, true]);
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
    tiles.settle();
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

  it('does not wait for colours of tiles that are replaced', () => {
    const child = childTile(root, 2);
    add(root, { child_mask: 0b100, generation: 2 });
    add(child, { child_mask: 0b11, generation: 1 });
    add(childTile(child, 0), { generation: 2 });
    expect(tiles.progress(2)).toEqual({ current: 0, total: 1 });
    add(childTile(child, 1), { generation: 1 });
    expect(tiles.progress(2)).toEqual({ current: 1, total: 2 });
    recolour(childTile(child, 1), 2);
    expect(tiles.progress(2)).toEqual({ current: 2, total: 2 });
  });

  it('tells how what is drawn and visible may differ from the full mesh', () => {
    const half_mm = 0.001 / Math.sqrt(3);
    const coarse = { colour_error_levels: 9, temperature_error_celsius: 0.5 };
    add(root, { child_mask: 0b11, geometric_error_m: 0.02, position_step_m: half_mm, ...coarse });
    const all = () => true;
    expect(tiles.drawnError(all)).toMatchObject({ colour_levels: 9, temperature_celsius: 0.5 });
    expect(tiles.drawnError(all)?.position_m).toBeCloseTo(0.0205, 9);
    const none = Number.NaN;
    add(childTile(root, 0), { geometric_error_m: 0, position_step_m: half_mm, temperature_error_celsius: none });
    add(childTile(root, 1), { geometric_error_m: 0.003, position_step_m: half_mm, temperature_error_celsius: none });
    expect(tiles.drawnError(all)).toMatchObject({ colour_levels: 0, temperature_celsius: null });
    expect(tiles.drawnError(all)?.position_m).toBeCloseTo(0.0035, 9);
    expect(tiles.drawnError(() => false)).toBeNull();
  });

  it('tells which generations are drawn, of what is visible', () => {
    const child = childTile(root, 0);
    add(root, { child_mask: 0b1, generation: 3 });
    const all = () => true;
    expect([...tiles.drawnGenerations(all)]).toEqual([3]);
    add(child, { generation: 4 });
    expect([...tiles.drawnGenerations(all)]).toEqual([4]);
    expect(tiles.drawnGenerations(() => false).size).toBe(0);
    tiles.beginConnection();
    expect([...tiles.drawnGenerations(all)]).toEqual([null]);
  });

  it('tells from the colours how they have been rounded', () => {
    add(root, {}, 0b10101000);
    expect(tiles.drawnError(() => true)).toMatchObject({ colour_levels: 0, rounding_levels: 4 });
    tiles.addColours(frame(root, { generation: 2 }), new Uint8Array([255, 64, 32, 255, 0, 16, 48, 255, 16, 0, 0, 255]));
    expect(tiles.drawnError(() => true)?.rounding_levels).toBe(8);
    tiles.addColours(frame(root, { generation: 3 }), colours(1));
    expect(tiles.drawnError(() => true)?.rounding_levels).toBe(0);
  });

  it('gives every tile its own name', () => {
    const names = new Set([0, 1, 2, 3].flatMap((x) => [0, 1].map((y) => tileKey({ level: 2, x, y, z: 0 }))));
    expect(names.size).toBe(8);
  });
});

describe('TileSet, after a cut connection', () => {
  const left = childTile(root, 0);
  const right = childTile(root, 1);
  const claim = (tile: TileId, revision: number) => [tile.level, tile.x, tile.y, tile.z, revision];

  it('claims what it holds, what is drawn first, and no more than may be claimed', () => {
    add(right, { revision: 3 });
    add(root, { revision: 2, child_mask: 0b11 });
    tiles.addGeometry(frame(left, { revision: 4 }), geometry());
    expect(tiles.claims(10)).toEqual([claim(root, 2), claim(right, 3)]);
    add(left, { revision: 4 });
    expect(tiles.claims(10)).toEqual([claim(right, 3), claim(left, 4), claim(root, 2)]);
    expect(tiles.claims(2)).toEqual([claim(right, 3), claim(left, 4)]);
  });

  it('claims no more than a message holds with the layers of all that is drawn, and tells others as far as there is room', () => {
    add(root, { revision: 2, child_mask: 0b11, sequence: 1 });
    add(left, { revision: 3, sequence: 2 });
    add(right, { revision: 4, sequence: 3 });
    tiles.addSigma(frame(left, { revision: 3 }), { kind: 'sigma', codes: Uint16Array.of(1, 2, 3), scale: 1, offset: 0 });
    tiles.updateSelection();
    const told = (values: number) => {
      const claims = tiles.claims(10, values);
      return [claims.map(([, , , , revision]) => revision), tiles.layersOf(claims, values - CLAIM_VALUES * claims.length)];
    };
    const both = {
      raw: [],
      temperature_sigma: [0],
      colours: [
        [0, 2],
        [1, 3],
      ],
    };
    expect(told(9)).toEqual([[], { raw: [], temperature_sigma: [], colours: [] }]);
    expect(told(18)).toEqual([[3], { raw: [], temperature_sigma: [0], colours: [[0, 2]] }]);
    expect(told(24)).toEqual([[3, 4], both]);
    expect(told(25)).toEqual([[3, 4, 2], both]);
    expect(told(28)).toEqual([[3, 4, 2], { ...both, colours: [...both.colours, [2, 1]] }]);
  });

  it('colours held geometry when the claim is granted', () => {
    const parent = add(root, { child_mask: 0b11, generation: 40 });
    const [a, b] = [add(left, { revision: 7, generation: 40 }), add(right, { revision: 8, generation: 40 })];
    const claims = tiles.claims(10);
    tiles.beginConnection();
    resume(claims, true);
    tiles.updateSelection();
    expect([parent.visible, a.visible, b.visible]).toEqual([false, true, true]);
    recolour(left, 2, 7);
    recolour(right, 2, 8);
    expect([a.shade, b.shade, made.length]).toEqual([2, 2, 3]);
    tiles.settle();
    expect([parent.disposed, a.visible, b.visible]).toEqual([false, true, true]);
    recolour(root, 3);
    expect([parent.shade, parent.visible, a.visible]).toEqual([3, true, false]);
  });

  it('colours held geometry also when the colours come before the answer to the claim', () => {
    const drawable = add(root, { revision: 5, generation: 9 });
    const claims = tiles.claims(10);
    tiles.beginConnection();
    recolour(root, 1, 5);
    expect(drawable.shade).toBe(1);
    tiles.addColours(frame(root, { revision: 5, generation: 2 }), colours(77));
    expect(drawable.shade).toBe(1);
    resume(claims, true);
    expect([drawable.shade, made.length]).toEqual([77, 1]);
  });

  it('replaces geometry that is not current any more, and drops what was removed', () => {
    const old = add(left, { revision: 5 });
    const gone = add(right, { revision: 6 });
    const claims = tiles.claims(10);
    tiles.beginConnection();
    resume(claims, true);
    tiles.remove(right);
    tiles.addColours(frame(left, { revision: 9, generation: 1 }), colours(50));
    expect(old.disposed).toBe(false);
    tiles.addGeometry(frame(left, { revision: 9 }), geometry());
    tiles.settle();
    expect([old.disposed, gone.disposed, drawn()]).toEqual([true, true, 1]);
    expect(tiles.claims(10)).toEqual([claim(left, 9)]);
  });

  it('takes everything anew when the claim is not granted', () => {
    const old = add(root, { revision: 5, generation: 9 });
    const claims = tiles.claims(10);
    tiles.beginConnection();
    resume(claims, false);
    tiles.addColours(frame(root, { revision: 5, generation: 1 }), colours(50));
    expect([old.shade, old.disposed]).toEqual([1, false]);
    expect(tiles.claims(10)).toEqual([]);
    tiles.addGeometry(frame(root, { revision: 5 }), geometry());
    expect([old.disposed, made.at(-1)?.shade]).toEqual([true, 50]);
  });

  it('drops at the end what was not claimed, and claims again what was, through several cuts', () => {
    add(left, { revision: 5 });
    const unclaimed = add(right, { revision: 6 });
    const claims = tiles.claims(1);
    tiles.beginConnection();
    resume(claims, true);
    tiles.beginConnection();
    expect(tiles.claims(10)).toEqual([claim(left, 5)]);
    resume(tiles.claims(10), true);
    tiles.settle();
    expect(unclaimed.disposed).toBe(true);
    recolour(left, 1, 5);
    expect(made).toHaveLength(2);
  });

  it('claims colours by the frame that brought them, and counts what is current as of the new connection', () => {
    const parent = add(root, { child_mask: 0b11, revision: 5, generation: 9, sequence: 31 });
    const [a, b] = [
      add(left, { revision: 6, generation: 9, sequence: 32 }),
      add(right, { revision: 7, generation: 9, sequence: 33 }),
    ];
    tiles.addSigma(frame(right, { revision: 7 }), { kind: 'sigma', codes: Uint16Array.of(1, 2, 3), scale: 1, offset: 0 });
    let claims = tiles.claims(10);
    const place = (tile: TileId) => claims.findIndex(([level, x]) => level === tile.level && x === tile.x);
    const sequenceOf = (tile: TileId) => new Map(tiles.layersOf(claims).colours).get(place(tile));
    expect([root, left, right].map(sequenceOf)).toEqual([31, 32, 33]);
    expect(tiles.layersOf(claims).temperature_sigma).toEqual([place(right)]);

    tiles.beginConnection();
    resume(claims, true, [place(left), place(right)], 4);
    tiles.settle();
    expect([parent.visible, a.visible, b.visible]).toEqual([false, true, true]);
    expect([...tiles.drawnGenerations(() => true)]).toEqual([4]);
    expect(tiles.progress(4)).toEqual({ current: 2, total: 2 });
    expect(made).toHaveLength(3);
    // A coarse tile of the same generation hides none of them.
    recolour(root, 4, 5);
    expect([parent.visible, a.visible, b.visible]).toEqual([false, true, true]);
    recolour(left, 5, 6);

    // What came over this connection goes by its sequence, the rest as it was claimed.
    claims = tiles.claims(10);
    expect([root, left, right].map(sequenceOf)).toEqual([1, 1, 0]);
    tiles.beginConnection();
    resume(claims, true, [place(left)], 2);
    expect([root, left, right].map(sequenceOf)).toEqual([0, 0, 0]);
    expect(tiles.layersOf(claims).temperature_sigma).toEqual([place(right)]);
    // A newer answer stands in front of what was not confirmed.
    recolour(root, 2, 5);
    expect([parent.visible, a.visible, b.visible]).toEqual([true, false, false]);
    tiles.beginConnection();
    resume(claims, false);
    expect(tiles.layersOf(claims).colours).toEqual([]);
  });

  it('does not wait for tiles that are kept out of the picture', () => {
    add(root, { child_mask: 0b11, generation: 2 });
    add(left, { generation: 1 });
    add(right, { generation: 1 });
    expect(tiles.progress(2)).toEqual({ current: 0, total: 2 });
    tiles.settle();
    expect(tiles.progress(2)).toEqual({ current: 1, total: 1 });
    expect(tiles.progress(3)).toEqual({ current: 0, total: 1 });
    recolour(left, 3);
    expect(tiles.progress(3)).toEqual({ current: 1, total: 2 });
  });
});

describe('TileSet, which of two generations is drawn', () => {
  const left = childTile(root, 0);
  const right = childTile(root, 1);
  const visible = (...drawables: FakeDrawable[]) => drawables.map((drawable) => drawable.visible);

  it('puts a newer parent in front of older children until all of them are as new', () => {
    const parent = add(root, { child_mask: 0b11 });
    const [a, b] = [add(left), add(right)];
    expect(visible(parent, a, b)).toEqual([false, true, true]);
    recolour(root, 2);
    expect(visible(parent, a, b)).toEqual([true, false, false]);
    recolour(left, 2);
    expect(visible(parent, a, b)).toEqual([true, false, false]);
    recolour(right, 2);
    expect(visible(parent, a, b)).toEqual([false, true, true]);
  });

  it('keeps newer children in front of an older parent', () => {
    const parent = add(root, { child_mask: 0b11 });
    const [a, b] = [add(left), add(right)];
    recolour(right, 3);
    recolour(left, 2);
    expect(visible(parent, a, b)).toEqual([false, true, true]);
    recolour(root, 2);
    expect(visible(parent, a, b)).toEqual([false, true, true]);
    recolour(root, 3);
    expect(visible(parent, a, b)).toEqual([true, false, false]);
  });

  it('does not draw a tile between for being old, nor lets it hide newer children', () => {
    const parent = add(root, { child_mask: 0b11 });
    const between = add(left, { child_mask: 0b11 });
    const [a, b, c] = [add(childTile(left, 0)), add(childTile(left, 1)), add(right)];
    expect(visible(parent, between, a, b, c)).toEqual([false, false, true, true, true]);
    recolour(root, 2);
    expect(visible(parent, between, a, b, c)).toEqual([true, false, false, false, false]);
    recolour(childTile(left, 0), 2);
    recolour(right, 2);
    expect(visible(parent, between, a, b, c)).toEqual([true, false, false, false, false]);
    recolour(childTile(left, 1), 2);
    expect(visible(parent, between, a, b, c)).toEqual([false, false, true, true, true]);
  });

  it('draws a preview between as soon as it and its neighbours are new', () => {
    const parent = add(root, { child_mask: 0b11 });
    const between = add(left, { child_mask: 0b11 });
    const [a, b, c] = [add(childTile(left, 0)), add(childTile(left, 1)), add(right)];
    recolour(root, 2);
    recolour(left, 2);
    recolour(right, 2);
    expect(visible(parent, between, a, b, c)).toEqual([false, true, false, false, true]);
    recolour(childTile(left, 0), 2);
    recolour(childTile(left, 1), 2);
    expect(visible(parent, between, a, b, c)).toEqual([false, false, true, true, true]);
  });

  it('goes on with the coarse answer when the generation rises half-way', () => {
    const parent = add(root, { child_mask: 0b11 });
    const [a, b] = [add(left), add(right)];
    recolour(root, 2);
    recolour(left, 2);
    recolour(root, 3);
    recolour(right, 3);
    expect(visible(parent, a, b)).toEqual([true, false, false]);
    expect(parent.shade).toBe(3);
    recolour(left, 3);
    expect(visible(parent, a, b)).toEqual([false, true, true]);
  });

  it('draws what is new of this connection before detail of an earlier one, whatever the numbers say', () => {
    const parent = add(root, { child_mask: 0b11, generation: 90 });
    const [a, b] = [add(left, { generation: 90 }), add(right, { generation: 90 })];
    tiles.beginConnection();
    tiles.updateSelection();
    expect(visible(parent, a, b)).toEqual([false, true, true]);
    const newParent = add(root, { child_mask: 0b11, generation: 1 });
    expect([parent.disposed, ...visible(newParent, a, b)]).toEqual([true, true, false, false]);
    const newA = add(left, { generation: 1 });
    expect(visible(newParent, newA, b)).toEqual([true, false, false]);
    const newB = add(right, { generation: 1 });
    expect(visible(newParent, newA, newB)).toEqual([false, true, true]);
  });

  it('keeps new geometry of a drawn tile on the screen', () => {
    const old = add(root);
    const next = add(root, { revision: 2, generation: 1 });
    expect([old.disposed, next.visible]).toEqual([true, true]);
  });

  it('knows which colours would take detail off the screen', () => {
    add(root, { child_mask: 0b11 });
    add(left);
    expect(tiles.wouldHideDetail(frame(root, { generation: 2 }))).toBe(false);
    add(right);
    expect(tiles.wouldHideDetail(frame(root, { generation: 1 }))).toBe(false);
    expect(tiles.wouldHideDetail(frame(root, { generation: 2 }))).toBe(true);
    expect(tiles.wouldHideDetail(frame(left, { generation: 2 }))).toBe(false);
    recolour(left, 2);
    expect(tiles.wouldHideDetail(frame(root, { generation: 2 }))).toBe(true);
    tiles.addColours(frame(right, { generation: 2 }), colours(2));
    expect(tiles.wouldHideDetail(frame(root, { generation: 2 }))).toBe(false);
    recolour(root, 3);
    expect(tiles.wouldHideDetail(frame(root, { generation: 4 }))).toBe(false);
  });
});

describe('TileSet, raw layers', () => {
  const child = (octant: number) => childTile(root, octant);
  const rawFrame = (tile: TileId, part: Partial<TileFrame> = {}) =>
    frame(tile, { child_mask: masks.get(tileKey(tile)) ?? 0, vertex_count: 3, ...part });

  function addRaw(tile: TileId, part: Partial<TileFrame> = {}): void {
    tiles.addRaw(rawFrame(tile, part), { kind: 'temperature', codes: new Uint16Array(3), scale: 0.01, offset: 20 });
    tiles.addRaw(rawFrame(tile, part), { kind: 'visible', rgb: new Uint8Array(9) });
  }

  it('go to what draws when both are there, and are counted', () => {
    const top = add(root);
    tiles.updateSelection();
    tiles.addRaw(rawFrame(root), { kind: 'visible', rgb: new Uint8Array(9) });
    expect(top.raw).toBeNull();
    expect(tiles.rawCounts()).toEqual({ drawn: 1, raw: 0, step_celsius: 0, waiting: 0 });
    addRaw(root);
    expect(top.raw).toMatchObject({ scale: 0.01, offset: 20 });
    expect(tiles.rawCounts()).toEqual({ drawn: 1, raw: 1, step_celsius: 0.01, waiting: 0 });
  });

  it('take temperatures in another step alone, and know which will come no finer', () => {
    const top = add(root);
    const temperatures = (scale: number, ...codes: number[]) =>
      tiles.addRaw(rawFrame(root), { kind: 'temperature', codes: Uint16Array.from(codes), scale, offset: 20 });
    addRaw(root);
    temperatures(0.01, 0, 65532, 65535);
    tiles.setHere(true);
    tiles.updateSelection();
    expect(top.raw).toMatchObject({ scale: 0.01, rgb: new Uint8Array(9) });
    const claims = tiles.claims(10);
    // A span of 655 degrees has no room for others, one of a degree has, as long as floats have.
    expect(tiles.rawCounts(0.001)).toEqual({ drawn: 1, raw: 1, step_celsius: 0.01, waiting: 0 });
    expect(tiles.layersOf(claims, Infinity, 0.001).raw).toEqual([0]);
    temperatures(0.01, 0, 100, 65535);
    expect(tiles.rawCounts()).toEqual({ drawn: 1, raw: 1, step_celsius: 0.01, waiting: 0 });
    expect(tiles.rawCounts(0.01)).toEqual({ drawn: 1, raw: 1, step_celsius: 0.01, waiting: 0 });
    expect(tiles.rawCounts(0.001)).toEqual({ drawn: 1, raw: 1, step_celsius: 0, waiting: 0 });
    expect(tiles.layersOf(claims, Infinity, 0.001).raw).toEqual([]);
    expect(tiles.drawnError(() => true)?.rounding_celsius).toBe(0.005);
    temperatures(0.001, 0, 1000, 65535);
    expect(top.raw).toMatchObject({ scale: 0.001, codes: Uint16Array.of(0, 1000, 65535), rgb: new Uint8Array(9) });
    expect(tiles.rawCounts(0.001)).toEqual({ drawn: 1, raw: 1, step_celsius: 0.001, waiting: 0 });
    expect(tiles.drawnError(() => true)?.rounding_celsius).toBe(0.0005);
    temperatures(2 ** -18, 0, 5, 65535);
    expect(tiles.rawCounts(1e-9)).toMatchObject({ step_celsius: 2 ** -18 });
    // Where nothing has a temperature there are no steps.
    temperatures(1, 65535, 65534, 65533);
    expect(tiles.rawCounts(0.001)).toEqual({ drawn: 1, raw: 1, step_celsius: 0, waiting: 0 });
    tiles.setHere(false);
    expect(tiles.drawnError(() => true)?.rounding_celsius).toBe(0);
    expect(() => temperatures(0.01, 0, 1)).toThrow(RawMismatch);
    expect(made.length).toBe(1);
  });

  it('leave none of the colours of before: those are not claimed, and the step is said until others have come', () => {
    add(root, { sequence: 7 });
    addRaw(root);
    tiles.updateSelection();
    const state = () => [tiles.layersOf(tiles.claims(10)).colours, tiles.drawnError(() => true)?.rounding_celsius];
    expect(state()).toEqual([[[0, 7]], 0]);
    tiles.setHere(true);
    expect(state()).toEqual([[], 0.005]);
    // Those of the robot wait, as long as they are made here.
    tiles.addColours(frame(root, { generation: 2, sequence: 8 }), colours(8));
    expect(state()).toEqual([[], 0.005]);
    tiles.setHere(false);
    expect(state()).toEqual([[[0, 8]], 0]);
    tiles.setHere(true);
    tiles.setHere(false);
    expect(state()).toEqual([[], 0.005]);
    tiles.addColours(frame(root, { generation: 3, sequence: 9 }), colours(9));
    expect(state()).toEqual([[[0, 9]], 0]);
  });

  it('of another revision wait for their geometry', () => {
    const top = add(root);
    addRaw(root, { revision: 2 });
    expect(top.raw).toBeNull();
    const next = add(root, { revision: 2 });
    expect(next.raw).not.toBeNull();
  });

  it('of an earlier revision that are decoded late take nothing of a later one away, nor do its colours or its geometry', () => {
    add(root);
    const temperature = { kind: 'temperature', codes: new Uint16Array(3), scale: 0.01, offset: 20 } as const;
    const visible = { kind: 'visible', rgb: new Uint8Array(9) } as const;
    tiles.addRaw(rawFrame(root, { revision: 3 }), temperature);
    tiles.addRaw(rawFrame(root, { revision: 2 }), visible);
    tiles.addRaw(rawFrame(root, { revision: 3 }), visible);
    tiles.addGeometry(frame(root, { revision: 3 }), geometry());
    tiles.addGeometry(frame(root, { revision: 2 }), geometry());
    tiles.addColours(frame(root, { revision: 3 }), colours(3));
    expect(made.at(-1)).toMatchObject({ shade: 3, raw: { scale: 0.01 } });
    tiles.addColours(frame(root, { revision: 5 }), colours(5));
    tiles.addColours(frame(root, { revision: 4 }), colours(4));
    tiles.addGeometry(frame(root, { revision: 5 }), geometry());
    expect(made.at(-1)).toMatchObject({ shade: 5 });
  });

  it('that do not fit are refused', () => {
    add(root);
    const codes = new Uint16Array(4);
    expect(() => tiles.addRaw(rawFrame(root), { kind: 'temperature', codes, scale: 1, offset: 0 })).toThrow(RawMismatch);
    expect(() =>
      tiles.addRaw(rawFrame(root, { vertex_count: 4 }), { kind: 'temperature', codes, scale: 1, offset: 0 }),
    ).not.toThrow();
    expect(() => tiles.addRaw(rawFrame(root, { vertex_count: 4 }), { kind: 'visible', rgb: new Uint8Array(12) })).toThrow(
      RawMismatch,
    );
  });

  it('make a tile without colours while fusing is here, and not before', () => {
    tiles.addGeometry(frame(root), geometry());
    expect(tiles.rawCounts().waiting).toBe(1);
    addRaw(root);
    expect(made).toHaveLength(0);
    tiles.setHere(true);
    expect(made).toHaveLength(1);
    expect(made[0]?.visible).toBe(true);
    expect(tiles.rawCounts().waiting).toBe(0);
  });

  it('and colours cost what has come of them, of all tiles and not of those that are drawn alone', () => {
    add(root, { child_mask: 0b11 });
    for (const octant of [0, 1]) add(child(octant));
    const { raw_bytes, change_bytes } = tiles.costs();
    expect(raw_bytes).toBeCloseTo(9 * 2.3);
    // A colour frame is 100 bytes.
    expect(change_bytes).toBe(300);
    tiles.addColours(frame(root, { generation: 2, child_mask: 0b11, bytes: 900 }), colours(2));
    recolour(root, 3);
    expect(tiles.costs().change_bytes).toBe(1100);
    addRaw(child(0), { bytes: 6 });
    expect(tiles.costs().raw_bytes).toBeCloseTo(3 * 12);
    addRaw(child(1), { bytes: 8 });
    addRaw(root, { bytes: 5 });
    expect(tiles.costs().raw_bytes).toBe(12 + 16 + 10);
    addRaw(root, { bytes: 7 });
    expect(tiles.costs().raw_bytes).toBe(12 + 16 + 14);
    // Of a dearer method, which has not been seen, it is more than what came.
    tiles.clear();
    add(root);
    expect(tiles.costs().raw_bytes).toBeCloseTo(3 * 2.3);
  });

  it('draw a tile in front of detail that cannot follow the settings here', () => {
    const top = add(root, { child_mask: 0b11 });
    const children = [0, 1].map((octant) => add(child(octant)));
    addRaw(root);
    addRaw(child(0));
    tiles.updateSelection();
    expect(top.visible).toBe(false);
    tiles.setHere(true);
    expect([top.visible, ...children.map(({ visible }) => visible)]).toEqual([true, false, false]);
    addRaw(child(1));
    tiles.updateSelection();
    expect([top.visible, ...children.map(({ visible }) => visible)]).toEqual([false, true, true]);
    // And as before when colours come from the server again.
    tiles.setHere(false);
    expect([top.visible, ...children.map(({ visible }) => visible)]).toEqual([false, true, true]);
  });

  it('are claimed beside their tiles', () => {
    add(root, { child_mask: 1 });
    add(child(0));
    addRaw(child(0));
    const claims = tiles.claims(10);
    expect(tiles.layersOf(claims).raw).toEqual([claims.findIndex(([level]) => level === 1)]);
    // Its colours have come, too.
    expect(tiles.layersOf(claims, 3)).toEqual({ raw: [], temperature_sigma: [], colours: [] });
  });
});
