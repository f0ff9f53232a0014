import { describe, expect, it } from 'vitest';
import type { GeometrySummary } from '../decode/messages';
import type { Scene, Vec3 } from '../protocol/messages';
import type { Bounds, UpAxis, View } from './first_view';
import { decodedGeometry } from '../tiles/test_tiles';
import { FirstLook } from './first_look';
import { UpChoices } from './up_choices';

function scene(part: Partial<Scene> = {}): Scene {
  return {
    name: 'room',
    bounds: { min: [0, 0, 0], max: [8, 6, 3] },
    up: 'z',
    ...part,
  } as Scene;
}

/** A tile with these vertices. */
function tile(points: readonly Vec3[], facing: Vec3 = [0, 0, 1]): GeometrySummary {
  return { ...decodedGeometry(3).summary, sample: Float32Array.from(points.flat()), normal_sum: facing, area_sum: 1 };
}
const grid = (size: number): Vec3[] =>
  Array.from({ length: 400 }, (_, i) => [((i % 20) / 19) * size, (Math.floor(i / 20) / 19) * size, 0]);

function setUp(choices = new UpChoices(null)) {
  const tiles: GeometrySummary[] = [];
  const seen = {
    view: null as View | null,
    views: 0,
    isTravel: false,
    movesInFull: true,
    up: null as UpAxis | null,
    reach: [0, 0] as [number, number],
    aspect: 1.5,
  };
  const look = new FirstLook(
    {
      get pose() {
        const { eye, target } = seen.view ?? { eye: [1, 1, 1], target: [0, 0, 0] };
        return { eye, target, up: [0, 0, 1] as Vec3, fov_y_deg: 45, viewport: [900, 600] as [number, number] };
      },
      get aspect() {
        return seen.aspect;
      },
      get movesInFull() {
        return seen.movesInFull;
      },
      setUpAxis: () => undefined,
      setView: (view, isTravel) => {
        seen.view = view;
        seen.isTravel = isTravel;
        seen.views += 1;
      },
      setReach: (nearest, farthest) => {
        seen.reach = [nearest, farthest];
      },
    },
    choices,
    () => tiles.map((geometry, i) => ({ level: i === 0 ? 0 : 1, geometry })),
    (up) => {
      seen.up = up;
    },
  );
  const distance = () => Math.hypot(...[0, 1, 2].map((axis) => seen.view!.eye[axis]! - seen.view!.target[axis]!));
  return { look, tiles, seen, distance };
}

describe('FirstLook', () => {
  it('is the same whether finer tiles came with the first or not', () => {
    const alone = setUp();
    const together = setUp();
    for (const { look, tiles } of [alone, together]) {
      look.sceneIs(scene());
      tiles.push(tile(grid(8)));
    }
    together.tiles.push(tile(grid(3), [0, -1, 0]), tile(grid(5), [1, 0, 0]));
    alone.look.pictureChanged();
    together.look.pictureChanged();
    expect(together.seen.view).toEqual(alone.seen.view);
  });

  it('is decided by the first tile and then left alone', () => {
    const { look, tiles, seen } = setUp();
    look.sceneIs(scene());
    tiles.push(tile(grid(8)));
    look.pictureChanged();
    const { view, views } = seen;
    tiles.push(tile(grid(3), [0, -1, 0]), tile(grid(5), [1, 0, 0]));
    look.pictureChanged();
    expect(seen.view).toEqual(view);
    expect(seen.views).toBe(views);
    look.reset();
    expect(seen.view).toEqual(view);
  });

  it('follows the size of the picture until the user takes the camera', () => {
    const { look, tiles, seen, distance } = setUp();
    look.sceneIs(scene());
    tiles.push(tile(grid(8)));
    look.pictureChanged();
    const before = distance();
    seen.aspect = 0.5;
    look.pictureIs(null);
    expect(distance()).toBeGreaterThan(before * 1.3);
    look.userMoved();
    const { views } = seen;
    look.pictureIs({ left: 0.1, right: 0.3, top: 0, bottom: 0 });
    expect(seen.views).toBe(views);
    look.reset();
    expect(seen.views).toBe(views + 1);
  });

  it('does not take the camera from a user who was faster than the first tile', () => {
    const { look, tiles, seen } = setUp();
    look.sceneIs(scene());
    look.userMoved();
    const { views } = seen;
    tiles.push(tile(grid(8)));
    look.pictureChanged();
    expect(seen.views).toBe(views);
  });

  it.each([
    ['as the drawn points tell', {}],
    ['as the server tells', { core_bounds: { min: [0, 0, 0] as Vec3, max: [8, 8, 1] as Vec3 } }],
  ])('shows the scene without its strays, %s', (_how, part) => {
    const { look, tiles, distance } = setUp();
    look.sceneIs(scene({ bounds: { min: [0, 0, 0], max: [5000, 5000, 3] }, ...part }));
    tiles.push(tile([...grid(8), [5000, 5000, 0]]));
    look.pictureChanged();
    expect(distance()).toBeLessThan(30);
    tiles.push(tile([[4999, 5000, 0], ...Array.from({ length: 60 }, (): Vec3 => [5000, 5000, 0])]));
    look.fit();
    expect(distance()).toBeLessThan(30);
  });

  it('has the server say which way is up, and the user know better', () => {
    let text: string | null = null;
    const storage = { getItem: () => text, setItem: (_key: string, value: string) => (text = value) };
    const first = setUp(new UpChoices(storage));
    first.look.sceneIs(scene());
    expect(first.seen.up).toBe('z');
    first.look.chooseUp('-y');
    expect(first.seen.up).toBe('-y');
    first.look.sceneIs(scene({ name: 'hall' }));
    expect(first.seen.up).toBe('z');
    const later = setUp(new UpChoices(storage));
    later.look.sceneIs(scene());
    expect(later.seen.up).toBe('-y');
    later.look.chooseUp('z');
    expect(text).toBe('[]');
  });

  it('starts anew with another scene, and where the same one is elsewhere, but not while it grows', () => {
    const { look, tiles, seen } = setUp();
    look.sceneIs(scene());
    tiles.push(tile(grid(8)));
    look.pictureChanged();
    const { views } = seen;
    look.sceneIs(scene({ bounds: { min: [0, 0, 0], max: [9, 6, 3] } }));
    expect(seen.views).toBe(views);
    look.sceneIs(scene({ bounds: { min: [0, 0, 0], max: [9000, 6000, 3000] } }));
    expect(seen.views).toBe(views + 1);
    look.userMoved();
    look.sceneIs(scene({ bounds: { min: [0, 0, 0], max: [9, 6, 3] } }));
    expect(seen.views).toBe(views + 1);
    look.sceneIs(scene({ name: 'hall' }));
    expect(seen.views).toBe(views + 2);
  });

  it('follows a live map as it grows, from the same side, until the user takes the camera', () => {
    const { look, tiles, seen, distance } = setUp();
    const live = (size: number) => scene({ live: true, bounds: { min: [0, 0, 0], max: [size, size, 0] } });
    look.sceneIs(live(0));
    look.pictureChanged();
    const { views } = seen;
    tiles.push(tile(grid(2)));
    look.sceneIs(live(2));
    look.pictureChanged();
    expect(seen.views).toBe(views + 1);
    const first = distance();
    const direction = [0, 1, 2].map((axis) => (seen.view!.eye[axis]! - seen.view!.target[axis]!) / first);
    // The same again, and a little more: nothing that anybody would see.
    look.pictureChanged();
    tiles[0] = tile(grid(2.02));
    look.sceneIs(live(2.02));
    look.pictureChanged();
    expect(seen.views).toBe(views + 1);
    // Ten times as large, and its surfaces face another way.
    tiles[0] = tile(grid(20), [1, 0, 0]);
    look.sceneIs(live(20));
    look.pictureChanged();
    expect(seen.views).toBe(views + 2);
    expect(distance()).toBeGreaterThan(5 * first);
    direction.forEach((value, axis) =>
      expect((seen.view!.eye[axis]! - seen.view!.target[axis]!) / distance()).toBeCloseTo(value, 6),
    );
    // A corner goes and comes: its bounds are the same all the while.
    tiles[0] = tile(grid(20).filter(([x, y]) => x + y <= 20));
    look.pictureChanged();
    expect(seen.views).toBe(views + 3);
    tiles[0] = tile(grid(20));
    look.pictureChanged();
    expect(seen.views).toBe(views + 4);
    look.userMoved();
    tiles[0] = tile(grid(200));
    look.sceneIs(live(200));
    look.pictureChanged();
    expect(seen.views).toBe(views + 4);
    // Back to the first view is to all that there is by now.
    look.reset();
    expect(distance()).toBeGreaterThan(50 * first);
  });

  it('follows a live map at once where moving would cost detail', () => {
    const { look, tiles, seen } = setUp();
    const grow = (size: number) => {
      tiles[0] = tile(grid(size));
      look.sceneIs(scene({ live: true, bounds: { min: [0, 0, 0], max: [size, size, 0] } }));
      look.pictureChanged();
    };
    grow(2);
    grow(3);
    expect(seen.isTravel).toBe(true);
    seen.movesInFull = false;
    grow(4);
    expect(seen.isTravel).toBe(false);
    // Who asks for it sees the way.
    look.reset();
    expect(seen.isTravel).toBe(true);
  });

  it('follows what finer tiles show where the coarsest is that of before', () => {
    const { look, tiles, seen, distance } = setUp();
    tiles.push(tile(grid(2)));
    look.sceneIs(scene({ live: true, bounds: { min: [0, 0, 0], max: [2, 2, 0] } }));
    look.pictureChanged();
    const { views } = seen;
    const first = distance();
    tiles.push(tile(grid(20))); // finer than the first
    look.sceneIs(scene({ live: true, bounds: { min: [0, 0, 0], max: [20, 20, 0] } }));
    look.pictureChanged();
    expect(seen.views).toBe(views + 1);
    expect(distance()).toBeGreaterThan(5 * first);
  });

  it('leaves a scene that is not live where it was decided, whatever comes', () => {
    const { look, tiles, seen } = setUp();
    look.sceneIs(scene());
    tiles.push(tile(grid(2)));
    look.pictureChanged();
    const { views } = seen;
    tiles[0] = tile(grid(8));
    look.pictureChanged();
    expect(seen.views).toBe(views);
  });

  it('lets the controls near the finest detail, and go back to see everything', () => {
    const { look, seen } = setUp();
    look.sceneIs(scene({ bounds: { min: [0, 0, 0], max: [4000, 0, 3000] } }));
    expect(seen.reach).toEqual([expect.closeTo(5e-3, 9), 50_000]);
    const core_bounds = { min: [0, 0, 0], max: [4, 0, 3] } as Bounds;
    look.sceneIs(scene({ name: 'strays', bounds: { min: [0, 0, 0], max: [4000, 0, 3000] }, core_bounds }));
    expect(seen.reach).toEqual([expect.closeTo(5e-6, 9), 50_000]);
    look.sceneIs(scene({ name: 'dot', bounds: { min: [1, 1, 1], max: [1, 1, 1] } }));
    expect(seen.reach[0]).toBeGreaterThan(0);
    expect(seen.reach[0]).toBeLessThan(0.01);
  });

  it('does nothing without a scene', () => {
    const { look, seen } = setUp();
    look.fit();
    look.reset();
    look.pictureIs(null);
    look.pictureChanged();
    look.sceneIs(null);
    expect(seen.views).toBe(0);
  });
});
