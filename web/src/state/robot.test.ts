import { describe, expect, it } from 'vitest';
import type { RobotMoved, Vec3 } from '../protocol/messages';
import { robotAfter } from './robot';

const moved = (first: number, points: Vec3[], lost?: boolean): RobotMoved => ({
  at: 1,
  position: [9, 0, 0],
  forward: [1, 0, 0],
  up: [0, 0, 1],
  ...(lost === undefined ? {} : { lost }),
  path: { first, points },
});

describe('The way of the robot', () => {
  it('grows, and is replaced from where it is told anew', () => {
    const begun = robotAfter(
      null,
      moved(0, [
        [0, 0, 0],
        [1, 0, 0],
      ]),
    );
    const on = robotAfter(begun, moved(2, [[2, 0, 0]]));
    expect(on.path).toEqual([
      [0, 0, 0],
      [1, 0, 0],
      [2, 0, 0],
    ]);
    expect(begun.path.length).toBe(2);
    expect(robotAfter(on, moved(0, [[5, 5, 5]])).path).toEqual([[5, 5, 5]]);
    expect(robotAfter(on, moved(3, [])).path).toEqual(on.path);
  });

  it('says whether the robot knows where it is', () => {
    expect(robotAfter(null, moved(0, [])).isLost).toBe(false);
    expect(robotAfter(null, moved(0, [], true)).isLost).toBe(true);
  });
});
