import type { Vec3 } from '../protocol/messages';
import type { SightWish } from '../draw/clear_sight';
import type { Bounds } from './first_view';

/** Distance to what is flown to, as a share of the scene's diagonal. */
const SIGHT_SHARE = 0.08;

/**
 * From where a place is to be seen when somebody flies to it: near, and from the side that the eye is on if that can be. `core`: the scene
 * without its strays; `step_m`: of the positions, which is nearer than anything that can be in between.
 */
export function flightTo(target: Vec3, eye: Vec3, { min, max }: Bounds, step_m: number): SightWish {
  const size = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) || 1;
  const [x, y, z] = [eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]];
  const away = Math.hypot(x, y, z) || 1;
  return {
    target,
    distance: size * SIGHT_SHARE,
    tolerance: Math.min(size * 1e-3, 3 * step_m),
    preferred: [x / away, y / away, z / away],
  };
}
