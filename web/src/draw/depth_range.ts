import type { Vec3 } from '../protocol/messages';

/** Part of what is drawn, as a sphere: metres relative to the scene origin. */
export interface DrawnSphere {
  centre: Vec3;
  radius: number;
}

export interface DepthRange {
  /** Distances of the two planes along the view direction, metres. */
  near: number;
  far: number;
  /** A depth buffer of 24 bits that is linear in 1 / depth cannot tell surfaces apart in the far part of this range. */
  isWide: boolean;
}

/** Nearest that something may be and still be drawn, as a share of the distance to what is looked at. */
const NEAREST_SHARE = 1e-5;
/** With a wider range than this, steps of depth at the far end come near the width of a pixel. */
const WIDEST_PLAIN = 2000;
/** The planes stand off a little: vertices are rounded on their way to the screen. */
const MARGIN = 0.001;

/**
 * The range of depths that has everything drawn in it: from the nearest of the spheres before the eye, though never nearer than a
 * share of the distance to what is looked at, to the farthest of them. `forward` has length 1.
 */
export function depthRange(eye: Vec3, forward: Vec3, distance: number, spheres: Iterable<DrawnSphere>): DepthRange {
  const nearest = Math.max(distance, 1e-9) * NEAREST_SHARE;
  let near = Infinity;
  let far = 0;
  for (const { centre, radius } of spheres) {
    const depth = (centre[0] - eye[0]) * forward[0] + (centre[1] - eye[1]) * forward[1] + (centre[2] - eye[2]) * forward[2];
    if (depth + radius <= 0) continue;
    near = Math.min(near, depth - radius);
    far = Math.max(far, depth + radius);
  }
  near = near === Infinity ? nearest : Math.max(nearest, near * (1 - MARGIN));
  far = Math.max(far * (1 + MARGIN), near * 2);
  return { near, far, isWide: far > near * WIDEST_PLAIN };
}
