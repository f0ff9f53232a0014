import { describe, expect, it } from 'vitest';
import { LONGEST_MOVING_MS, MotionPace, type Notch } from './motion_pace';

/** A machine that takes so long for a picture: a part by the pixels, a part by the detail, each level a third of the one before. */
const machine = (pixels_ms: number, detail_ms: number) => (notch: Notch | null) =>
  pixels_ms * (notch?.resolution ?? 1) ** 2 + detail_ms / 3 ** (notch?.levels ?? 0);

function move(pace: MotionPace, takes: (notch: Notch | null) => number, pictures: number): number[] {
  return Array.from({ length: pictures }, () => {
    const notch = pace.moving;
    const ms = takes(notch);
    pace.drawn(ms, notch);
    return ms;
  });
}

describe('MotionPace', () => {
  it('leaves a fast machine alone', () => {
    const pace = new MotionPace();
    pace.drawn(8, null);
    move(pace, machine(6, 6), 200);
    expect(pace.moving).toEqual({ resolution: 1, levels: 0 });
  });

  it.each([
    [900, 100],
    [100, 900],
    [60, 5],
    [400, 400],
  ])('keeps within the limit after a few pictures where it can be (%d ms by pixels, %d by detail)', (pixels, detail) => {
    const pace = new MotionPace();
    const takes = machine(pixels, detail);
    pace.drawn(takes(null), null);
    const times = move(pace, takes, 100);
    expect(times.slice(0, 5).filter((ms) => ms > 150).length).toBeLessThanOrEqual(1);
    // A better notch may be tried, and found too slow, once in a movement at most.
    const late = times.slice(5);
    const reachable = takes({ resolution: 0.25, levels: 5 }) <= LONGEST_MOVING_MS;
    if (reachable) expect(late.filter((ms) => ms > LONGEST_MOVING_MS).length).toBeLessThanOrEqual(1);
  });

  it('knows from the full picture how to begin', () => {
    const pace = new MotionPace();
    pace.drawn(1000, null);
    expect(machine(500, 500)(pace.moving)).toBeLessThan(100);
  });

  it('comes back when the scene gets lighter', () => {
    const pace = new MotionPace();
    move(pace, machine(600, 600), 30);
    pace.drawn(10, null);
    move(pace, machine(5, 5), 200);
    expect(pace.moving.resolution).toBe(1);
  });

  it('takes pictures of an earlier notch for nothing', () => {
    const pace = new MotionPace();
    const early = pace.moving;
    pace.drawn(300, early);
    const { moving } = pace;
    pace.drawn(300, early);
    expect(pace.moving).toBe(moving);
  });
});
