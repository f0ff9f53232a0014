import type { Vec3 } from '../protocol/messages';
import type { View } from './first_view';

/** Where a camera of the scene is and which way it looks. */
export interface Stand {
  readonly position: Vec3;
  readonly forward: Vec3;
  readonly up: Vec3;
}

type Project = (point: Vec3) => { x: number; y: number; depth: number } | null;

const along = (from: Vec3, ...steps: [Vec3, number][]): Vec3 =>
  steps.reduce<Vec3>((at, [axis, length]) => at.map((value, i) => value + axis[i]! * length) as Vec3, from);
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (v: Vec3): Vec3 | null => {
  const length = Math.hypot(...v);
  return length > 1e-6 ? (v.map((value) => value / length) as Vec3) : null;
};

/** Between two stands, `share` of the way from the first to the second. */
export function between(a: Stand, b: Stand, share: number): Stand {
  const mix = (u: Vec3, v: Vec3): Vec3 => u.map((value, i) => value + (v[i]! - value) * share) as Vec3;
  return {
    position: mix(a.position, b.position),
    forward: unit(mix(a.forward, b.forward)) ?? b.forward,
    up: unit(mix(a.up, b.up)) ?? b.up,
  };
}

/** A line through places of the scene as the path of an SVG; what lies behind the camera is left out. */
export function lineThrough(points: readonly Vec3[], project: Project): string {
  let text = '';
  let isBegun = false;
  for (const point of points) {
    const at = project(point);
    if (at !== null) text += `${isBegun ? 'L' : 'M'}${at.x.toFixed(1)} ${at.y.toFixed(1)}`;
    isBegun = at !== null;
  }
  return text;
}

/** What is seen of the marker of a camera: a pyramid of its sight, at least LEAST_PX long on the screen; null behind who looks. */
export function markerOf({ position, forward, up }: Stand, project: Project): { x: number; y: number; d: string } | null {
  const at = project(position);
  if (at === null) return null;
  const probe = project(along(position, [UNIT_X, 0.01]));
  const probe2 = project(along(position, [UNIT_Y, 0.01]));
  const probe3 = project(along(position, [UNIT_Z, 0.01]));
  const px_per_m =
    100 * Math.max(...[probe, probe2, probe3].map((p) => (p === null ? 0 : Math.hypot(p.x - at.x, p.y - at.y))), 1e-6);
  const length = Math.max(LENGTH_M, LEAST_PX / px_per_m);
  const right: Vec3 = [
    forward[1] * up[2] - forward[2] * up[1],
    forward[2] * up[0] - forward[0] * up[2],
    forward[0] * up[1] - forward[1] * up[0],
  ];
  const corner = (x: number, y: number) =>
    along(position, [forward, length], [right, x * 0.55 * length], [up, y * 0.42 * length]);
  const corners: Vec3[] = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
  const parts = [
    lineThrough([...corners, corners[0]!], project),
    ...corners.map((end) => lineThrough([position, end], project)),
    // Up in its picture.
    lineThrough([corner(-0.4, 1.15), along(position, [forward, length], [up, 0.72 * length]), corner(0.4, 1.15)], project),
  ];
  return { x: at.x, y: at.y, d: parts.join('') };
}

/** From behind the robot and above it, upright in the scene. */
export function chaseView({ position, forward }: Stand, up: Vec3): View {
  const flat = unit(along(forward, [up, -dot(forward, up)])) ?? unit([up[1], up[2], up[0]])!;
  return {
    eye: along(position, [flat, -BEHIND_M], [up, ABOVE_M]),
    target: along(position, [flat, AHEAD_M]),
  };
}

const UNIT_X: Vec3 = [1, 0, 0];
const UNIT_Y: Vec3 = [0, 1, 0];
const UNIT_Z: Vec3 = [0, 0, 1];
const LENGTH_M = 0.25;
const LEAST_PX = 18;
const [BEHIND_M, ABOVE_M, AHEAD_M] = [2.2, 1.5, 1];
