import { describe, expect, it } from 'vitest';
import type { Fusion, Scene, StreamComplete } from '../protocol/messages';
import { Progress } from './progress';
import { Store } from './store.svelte';

function setUp() {
  const store = new Store();
  store.fusionInForce = { method: 'blend' } as Fusion;
  const tiles = { size: 0, current: 0, total: 0, progress: () => ({ current: tiles.current, total: tiles.total }) };
  const clock = { now: 1000, busy: false, answeredGeneration: 0 };
  const progress = new Progress(store, tiles, clock, () => clock.now);
  return { store, tiles, clock, progress };
}
const complete = (generation: number) => ({ generation }) as StreamComplete;

describe('the progress of a picture', () => {
  it('is behind from the first wish until all of it is there, and says what that took', () => {
    const { store, clock, progress } = setUp();
    store.generation = 4;
    progress.received(700);
    progress.begin();
    clock.now = 1100;
    // A second wish does not make the first one younger.
    progress.begin();
    expect(store.behindSince).toBe(1000);
    progress.received(5000);
    progress.completed(complete(4), 3);
    // It is still being drawn.
    progress.drawn(2);
    expect([store.behindSince, store.complete, store.pictureMethod]).toEqual([1000, null, null]);
    clock.now = 1250;
    progress.drawn(3);
    expect(store.behindSince).toBeNull();
    expect(store.progress).toBe(1);
    expect(store.lastUpdate).toEqual({ bytes: 5000, ms: 250 });
    expect(store.pictureMethod).toBe('blend');
  });

  it('is not at its end while newer settings are in force or on their way', () => {
    const { store, clock, progress } = setUp();
    store.generation = 4;
    progress.begin();
    progress.completed(complete(3), 1);
    progress.drawn(1);
    expect(store.behindSince).toBe(1000);
    expect(store.complete).toEqual(complete(3));
    clock.busy = true;
    progress.completed(complete(4), 1);
    progress.drawn(1);
    expect(store.behindSince).toBe(1000);
    expect(store.pictureMethod).toBeNull();
    clock.busy = false;
    progress.completed(complete(4), 1);
    progress.drawn(1);
    expect(store.behindSince).toBeNull();
  });

  it('of a map that grows all the time is behind of what has come since alone', () => {
    const { store, clock, progress } = setUp();
    const grows = (revision: number, at: number) => {
      clock.now = at;
      store.scene = { revision } as Scene;
      progress.begin();
    };
    const shows = (scene_revision: number, picture: number) => {
      progress.completed({ generation: 0, scene_revision } as StreamComplete, picture);
      progress.drawn(picture);
    };
    grows(1, 1000);
    grows(2, 1500);
    progress.received(400);
    grows(3, 1900);
    expect(store.behindSince).toBe(1000);
    clock.now = 2000;
    shows(2, 1);
    expect([store.behindSince, store.pictureMethod, store.lastUpdate]).toEqual([1900, 'blend', null]);
    // Settings are no other scene.
    clock.now = 2100;
    progress.begin(true);
    grows(4, 2200);
    shows(3, 2);
    expect(store.behindSince).toBe(2200);
    progress.received(70);
    clock.now = 2500;
    shows(4, 3);
    expect([store.behindSince, store.lastUpdate]).toEqual([null, { bytes: 70, ms: 300 }]);
    grows(5, 3000);
    expect(store.behindSince).toBe(3000);
  });

  it('of a map that is never complete is behind of what has not been sent, and never at its end', () => {
    const { store, clock, progress } = setUp();
    for (const [revision, at] of [
      [1, 1000],
      [2, 1500],
      [3, 1900],
      [4, 2300],
    ] as const) {
      clock.now = at;
      store.scene = { revision } as Scene;
      progress.begin();
    }
    progress.shows({ generation: 0, scene_revision: 2 }, 7);
    // It is still being drawn.
    progress.drawn(6);
    expect(store.behindSince).toBe(1000);
    progress.drawn(7);
    expect([store.behindSince, store.complete, store.lastUpdate]).toEqual([1900, null, null]);
    // The range has become another, and with it the generation.
    store.generation = 1;
    progress.shows({ generation: 0, scene_revision: 3 }, 8);
    progress.drawn(8);
    expect(store.behindSince).toBe(2300);
    clock.now = 2600;
    store.scene = { revision: 5 } as Scene;
    progress.begin();
    // Settings that were made here are not in it.
    clock.answeredGeneration = 1;
    progress.shows({ generation: 0, scene_revision: 4 }, 9);
    progress.drawn(9);
    expect(store.behindSince).toBe(2300);
    clock.busy = true;
    progress.shows({ generation: 1, scene_revision: 4 }, 10);
    progress.drawn(10);
    expect(store.behindSince).toBe(2300);
    clock.busy = false;
    for (const scene_revision of [4, 5]) {
      progress.shows({ generation: 1, scene_revision }, 11);
      progress.drawn(11);
      expect(store.behindSince).toBe(2600);
    }
    progress.completed({ generation: 1, scene_revision: 5 } as StreamComplete, 12);
    progress.drawn(12);
    expect(store.behindSince).toBeNull();
  });

  it('keeps little of a map that is never complete, and never says that less is missing than is', () => {
    const { store, clock, progress } = setUp();
    const announced: number[] = [];
    for (let revision = 0; revision < 40_000; revision += 1) {
      clock.now = announced[revision] = 1000 + revision * 200;
      store.scene = { revision } as Scene;
      progress.begin();
    }
    const since: number[] = [];
    for (let revision = 0; revision < 39_999; revision += 1) {
      progress.completed({ generation: 0, scene_revision: revision } as StreamComplete, revision + 1);
      progress.drawn(revision + 1);
      expect(store.behindSince).toBeLessThanOrEqual(announced[revision + 1]!);
      if (store.behindSince !== since.at(-1)) since.push(store.behindSince!);
      if (revision % 1000 === 999)
        expect(announced[revision + 1]! - store.behindSince!).toBeLessThan(0.02 * announced[revision]!);
    }
    expect(since.length).toBeLessThan(1000);
  });

  it('is not at its end while the scene is another one than that of the picture', () => {
    const { store, progress } = setUp();
    store.link = { phase: 'open' };
    store.scene = { revision: 3 } as Scene;
    store.drawnError = { position_m: 0.001, colour_levels: 0, rounding_levels: 0, rounding_celsius: 0, temperature_celsius: 0 };
    [store.pictureRevision, store.now] = [2, 1100];
    progress.begin();
    // For a moment nobody says so.
    expect(store.accuracy).toBe(store.drawnError);
    store.now = 1200;
    expect(store.accuracy).toBeNull();
    progress.completed({ generation: 0, scene_revision: 2 } as StreamComplete, 1);
    progress.drawn(1);
    expect([store.behindSince, store.accuracy]).toEqual([1000, null]);
    progress.completed({ generation: 0, scene_revision: 3 } as StreamComplete, 2);
    progress.drawn(2);
    expect([store.behindSince, store.accuracy]).toEqual([null, store.drawnError]);
    // What a connection of before has said counts no more.
    progress.begin();
    progress.completed({ generation: 0, scene_revision: 3 } as StreamComplete, 3);
    progress.disconnected();
    store.complete = null;
    progress.drawn(3);
    expect(store.complete).toBeNull();
  });

  it('is that of the method that is named before the first picture is complete, too', () => {
    const { store, tiles, progress } = setUp();
    store.link = { phase: 'open' };
    store.scene = { tile_count: 8 } as Scene;
    store.shownMethods = ['visible'];
    [tiles.size, tiles.current, tiles.total] = [8, 1, 4];
    progress.begin();
    store.now = 2000;
    progress.tick();
    expect([store.methodIsPending, store.progress]).toEqual([true, 0.25]);
    store.shownMethods = ['blend'];
    progress.tick();
    expect([store.methodIsPending, store.progress]).toEqual([false, 1]);
    // Without a link, too.
    store.shownMethods = ['visible'];
    store.link = { phase: 'connecting', attempt: 2 };
    expect(store.methodIsPending).toBe(true);
  });

  it('is not behind of settings that were refused', () => {
    const { store, clock, progress } = setUp();
    store.generation = 4;
    store.complete = complete(4);
    progress.begin(true);
    clock.busy = true;
    progress.tick();
    expect(store.behindSince).toBe(1000);
    // Taken, they are another generation, which is to come.
    clock.busy = false;
    store.generation = 5;
    progress.tick();
    expect(store.behindSince).toBe(1000);
    store.generation = 4;
    [store.progress, clock.now] = [0.5, 1400];
    progress.tick();
    expect(store.behindSince).toBeNull();
    // All of the picture is what is in force, as if it had been said to be complete.
    expect([store.progress, store.pictureMethod, store.lastUpdate]).toEqual([1, 'blend', { bytes: 0, ms: 400 }]);
    // The scene is another one, too.
    progress.begin();
    progress.begin(true);
    progress.tick();
    expect(store.behindSince).toBe(1400);
  });

  it('is the share of the tiles: of all there may be before the first picture, of those that are wanted after it', () => {
    const { store, tiles, progress } = setUp();
    store.scene = { tile_count: 8 } as Scene;
    progress.begin();
    tiles.size = 2;
    progress.tick();
    expect(store.progress).toBe(0.25);
    tiles.size = 12;
    progress.tick();
    expect(store.progress).toBe(1);
    progress.completed(complete(0), 1);
    progress.drawn(1);
    progress.begin();
    [tiles.current, tiles.total] = [3, 4];
    progress.tick();
    expect(store.progress).toBe(0.75);
    tiles.total = 0;
    progress.tick();
    expect(store.progress).toBe(0);
  });

  it('is not behind where there is no scene, whatever is asked for', () => {
    const { store, progress } = setUp();
    progress.begin();
    expect(store.behindSince).toBe(1000);
    store.scene = null;
    progress.begin();
    expect(store.behindSince).toBeNull();
    progress.begin(true);
    expect(store.behindSince).toBeNull();
    store.scene = {} as Scene;
    progress.begin();
    expect(store.behindSince).toBe(1000);
  });

  it('tells the rate of the last two seconds, and of nothing once the link is lost', () => {
    const { store, clock, progress } = setUp();
    progress.received(1000);
    clock.now += 1500;
    progress.received(3000);
    progress.tick();
    expect(store.rate_bytes_per_s).toBe(2000);
    clock.now += 600;
    progress.tick();
    expect(store.rate_bytes_per_s).toBe(1500);
    expect(store.received_bytes).toBe(4000);
    progress.begin();
    progress.disconnected();
    expect(store.rate_bytes_per_s).toBe(0);
    expect(store.behindSince).toBeNull();
  });

  it('is behind settings that are shown here until a picture with them has been drawn', () => {
    const { store, clock, progress } = setUp();
    store.complete = complete(1);
    store.link = { phase: 'open' };
    store.pictureMethod = 'blend';
    store.shownMethods = ['blend'];
    store.fusionInForce = { method: 'threshold' } as Fusion;
    progress.beginHere('other', 7);
    progress.beginHere('threshold', 7);
    progress.drawn(6);
    progress.tick();
    expect([store.hereSince, store.lateSince, store.progress, store.pictureMethod]).toEqual([1000, 1000, 0, 'blend']);
    store.now = 1100;
    expect([store.behind, store.settled, store.methodIsPending]).toEqual([false, true, false]);
    store.now = 1600;
    expect([store.behind, store.settled, store.methodIsPending]).toEqual([true, false, true]);
    // That the robot has sent all says nothing of what is drawn here.
    progress.completed(complete(1), 1);
    progress.drawn(1);
    expect(store.pictureMethod).toBe('blend');
    clock.now = 1600;
    progress.beginHere('threshold', 9);
    progress.drawn(8);
    expect([store.pictureMethod, store.hereSince]).toEqual(['threshold', 1600]);
    progress.drawn(9);
    progress.tick();
    expect([store.hereSince, store.progress, store.settled]).toEqual([null, 1, true]);
  });

  it('is not behind settings of here any more once the robot makes the colours', () => {
    const { store, progress } = setUp();
    progress.beginHere('threshold', 7);
    progress.leftHere();
    expect(store.hereSince).toBeNull();
    progress.completed(complete(1), 1);
    progress.drawn(1);
    expect(store.pictureMethod).toBe('blend');
    // Of a picture of before nothing is said any more.
    progress.drawn(8);
    expect(store.pictureMethod).toBe('blend');
  });

  it('is nothing while the server has not said what the named method is', () => {
    const { store, tiles, progress } = setUp();
    store.complete = complete(1);
    store.pictureMethod = 'blend';
    store.shownMethods = ['blend'];
    store.link = { phase: 'open' };
    [tiles.current, tiles.total] = [4, 4];
    progress.begin();
    progress.tick();
    expect([store.progress, store.otherMethods]).toEqual([1, []]);
    store.wanted = { method: 'threshold' };
    progress.tick();
    expect([store.progress, store.otherMethods]).toEqual([0, ['blend']]);
  });
});
