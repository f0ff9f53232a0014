import type { Vec3 } from '../protocol/messages';

/** From where and at what it is looked: the eye, what it aims at, and the axes of the picture in the scene, each of length 1. */
export interface Look {
  readonly eye: Vec3;
  readonly target: Vec3;
  readonly right: Vec3;
  readonly up: Vec3;
  /** Towards the viewer. */
  readonly back: Vec3;
}

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const unit = (v: Vec3): Vec3 | null => {
  const length = Math.hypot(...v);
  return length > 1e-9 ? [v[0] / length, v[1] / length, v[2] / length] : null;
};

/** Looks from `eye` at `target` with `up` upwards in the picture; straight along `up` any direction will do. */
export function lookAt(eye: Vec3, target: Vec3, up: Vec3): Look {
  const back = unit(minus(eye, target)) ?? [0, 0, 1];
  const right = unit(cross(up, back)) ?? unit(cross([up[1], up[2], up[0]], back))!;
  return { eye, target, right, up: cross(back, right), back };
}

/** The matrix from the camera's space to the scene's, column by column. */
export function worldFromCamera({ eye, right, up, back }: Look): number[] {
  return [...right, 0, ...up, 0, ...back, 0, ...eye, 1];
}

/** The other way round: a look whose matrix is `m`. */
export function lookOf(m: readonly number[], target: Vec3): Look {
  const column = (i: number): Vec3 => [m[4 * i]!, m[4 * i + 1]!, m[4 * i + 2]!];
  return { right: column(0), up: column(1), back: column(2), eye: column(3), target };
}

/** A point of the scene as the camera sees it: to the right, upwards, towards the viewer. */
export function toView({ eye, right, up, back }: Look, point: Vec3): Vec3 {
  const away = minus(point, eye);
  return [dot(away, right), dot(away, up), dot(away, back)];
}

/** A direction as the camera sees it, in the scene. */
export function directionInScene({ right, up, back }: Look, [x, y, z]: Vec3): Vec3 {
  return [0, 1, 2].map((axis) => x * right[axis]! + y * up[axis]! + z * back[axis]!) as Vec3;
}

export function distanceOf({ eye, target }: Look): number {
  return Math.hypot(...minus(eye, target));
}
