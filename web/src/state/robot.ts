import type { RobotMoved, Vec3 } from '../protocol/messages';

/** The robot that maps the scene, in the coordinates of the map. */
export interface Robot {
  readonly position: Vec3;
  /** Where it looks, and up in its picture; of length 1. */
  readonly forward: Vec3;
  readonly up: Vec3;
  /** It does not know where it is: this is where it was last. */
  readonly isLost: boolean;
  /** The way it has come, without where it is now. */
  readonly path: readonly Vec3[];
}

/** What is known of the robot after it was told of. */
export function robotAfter(before: Robot | null, { position, forward, up, lost, path }: RobotMoved): Robot {
  const kept = before?.path.slice(0, path.first) ?? [];
  return { position, forward, up, isLost: lost === true, path: [...kept, ...path.points] };
}
