import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { CameraPose, Extremes, Vec3 } from '../protocol/messages';
import { type Mark, Markers, type Window } from './markers';

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

/** Looks along -z from z = 10; `front` is the depth at which a ray meets something. */
function setUp(front: () => number | null, inView: () => Extremes | null = () => null) {
  let marks: Mark[] = [];
  let picks = 0;
  const asked: Window[] = [];
  const pose: CameraPose = { eye: [0, 0, 10], target: [0, 0, 0], up: [0, 1, 0], fov_y_deg: 45, viewport: [100, 100] };
  const markers = new Markers(
    {
      pose,
      size: [100, 100],
      project: ([x, y, z]: Vec3) => (z > 10 ? null : { x: 50 + x, y: 50 - y, depth: 10 - z }),
      pick: (x: number, y: number) => {
        picks += 1;
        const depth = front();
        return Promise.resolve(depth === null ? null : [x - 50, 50 - y, 10 - depth]);
      },
    },
    (depth) => depth / 500,
    (_camera, window) => {
      asked.push(window);
      return Promise.resolve(inView());
    },
    (next) => {
      marks = next;
    },
  );
  return { markers, marks: () => marks, picks: () => picks, pose, asked };
}
const extremes = {
  hottest: { position: [1, 2, 0] as Vec3, temperature: 57 },
  coldest: { position: [-300, 0, 0] as Vec3, temperature: 3 },
};

describe('Markers', () => {
  it('marks what is on the screen, and nothing else', () => {
    const { markers, marks } = setUp(() => null);
    markers.extremesAre(extremes);
    expect(marks()).toEqual([{ kind: 'hottest', of: 'scene', temperature: 57, x: 51, y: 48, isHidden: false }]);
    markers.extremesAre({ hottest: null, coldest: { position: [0, 0, 11], temperature: 3 } });
    expect(marks()).toEqual([]);
    markers.extremesAre(null);
    expect(marks()).toEqual([]);
  });

  it('marks nothing where all is of one temperature', () => {
    const { markers, marks } = setUp(() => null);
    markers.extremesAre({ ...extremes, coldest: { position: [4, 4, 0], temperature: 57 } });
    expect(marks()).toEqual([]);
  });

  it('marks as the hottest what the sensor could not tell any more', () => {
    const { markers, marks } = setUp(() => null);
    markers.extremesAre({ ...extremes, over_range: [5, 5, 0], under_range: [-5, 5, 0] });
    expect(marks()).toMatchObject([
      { kind: 'hottest', temperature: Infinity, x: 55, y: 45 },
      { kind: 'coldest', temperature: -Infinity, x: 45, y: 45 },
    ]);
  });

  it('finds out at rest whether something stands before it', async () => {
    let front: number | null = 4;
    const { markers, marks, picks } = setUp(() => front);
    markers.extremesAre(extremes);
    await vi.advanceTimersByTimeAsync(100);
    markers.update();
    await vi.advanceTimersByTimeAsync(200);
    expect(picks()).toBe(0);
    await vi.advanceTimersByTimeAsync(100);
    expect(marks()[0]?.isHidden).toBe(true);
    // 2.6 cm is another surface, 1 cm may be the same.
    front = 9.974;
    markers.update();
    await vi.advanceTimersByTimeAsync(300);
    expect(marks()[0]?.isHidden).toBe(true);
    front = 9.99;
    markers.update();
    expect(marks()[0]?.isHidden).toBe(true);
    await vi.advanceTimersByTimeAsync(300);
    expect(marks()[0]?.isHidden).toBe(false);
    expect(picks()).toBe(3);
  });

  it('asks at rest for the extremes of what is on the screen, once for each view, and withdraws them as the camera moves', async () => {
    const seen = { hottest: extremes.hottest, coldest: { position: [5, 5, 0] as Vec3, temperature: 9 } };
    const { markers, marks, pose, asked } = setUp(
      () => null,
      () => seen,
    );
    markers.windowIs([0.1, 0, 0.8, 1]);
    markers.extremesAre(extremes);
    await vi.advanceTimersByTimeAsync(300);
    // The hottest of the scene is on the screen: it is marked once.
    const shown = () => marks().map(({ kind, of, temperature }) => [kind, of, temperature]);
    expect(shown()).toEqual([
      ['hottest', 'scene', 57],
      ['coldest', 'view', 9],
    ]);
    markers.update();
    await vi.advanceTimersByTimeAsync(300);
    expect(asked).toEqual([[0.1, 0, 0.8, 1]]);
    expect(shown()).toHaveLength(2);
    pose.eye = [0, 1, 10];
    markers.update();
    expect(shown()).toEqual([['hottest', 'scene', 57]]);
    await vi.advanceTimersByTimeAsync(300);
    expect(asked).toHaveLength(2);
    expect(shown()).toHaveLength(2);
  });
});
