import type { GeometrySummary } from '../decode/messages';
import type { Scene, Vec3 } from '../protocol/messages';

/** Which way is up in a scene, by its axes. */
export const UP_AXES = ['x', '-x', 'y', '-y', 'z', '-z'] as const;
export type UpAxis = (typeof UP_AXES)[number];
export type Bounds = Scene['bounds'];

export interface View {
  eye: Vec3;
  target: Vec3;
}

export const UP: Record<UpAxis, Vec3> = {
  x: [1, 0, 0],
  '-x': [-1, 0, 0],
  y: [0, 1, 0],
  '-y': [0, -1, 0],
  z: [0, 0, 1],
  '-z': [0, 0, -1],
};
/** The side that is looked at when nothing speaks for another one. */
export function frontOf(up: UpAxis): Vec3 {
  return up.endsWith('z') ? [0, -1, 0] : [0, 0, 1];
}

const LOWEST_ELEVATION = (14 * Math.PI) / 180;
const HIGHEST_ELEVATION = (38 * Math.PI) / 180;
const DEFAULT_AZIMUTH = (30 * Math.PI) / 180;
/** Share of the outermost sample points that may lie outside the picture: a few that stick out must not push the scene away. */
const TRIMMED = 0.004;
/** Stray points are few, and farther from the others than those reach, by this factor. */
const MOST_STRAYS = 0.02;
const STRAY_GAP = 3;
/** What is seen of a scene that is one place only, metres. */
const EXTENT_OF_A_PLACE = 0.5;

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
const sum = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const normalised = (a: Vec3): Vec3 => scaled(a, 1 / (Math.hypot(...a) || 1));

/** The mean normal of a surface, of length 0 (closed) to 1 (flat); zero for a point cloud. */
export function meanNormal(geometries: readonly GeometrySummary[]): Vec3 {
  let normal: Vec3 = [0, 0, 0];
  let area = 0;
  for (const geometry of geometries) {
    normal = sum(normal, geometry.normal_sum);
    area += geometry.area_sum;
  }
  return area > 0 ? scaled(normal, 1 / area) : [0, 0, 0];
}

/**
 * Where to look from. Scanned surfaces face the sensors that saw them, so the view is from the side the surface faces, between 14 and
 * 38 degrees above the horizon; without a preferred side, three-quarters from the front.
 */
export function viewDirection(facing: Vec3, up: UpAxis): Vec3 {
  const upward = UP[up];
  const front = frontOf(up);
  const right = cross(upward, front);
  const rise = dot(facing, upward);
  const level: Vec3 = sum(facing, scaled(upward, -rise));
  const strength = Math.hypot(...level);
  const azimuth = strength > 0.12 ? Math.atan2(dot(level, right), dot(level, front)) : DEFAULT_AZIMUTH;
  const natural = Math.hypot(...facing) > 0.12 ? Math.atan2(rise, strength) : (25 * Math.PI) / 180;
  const elevation = Math.min(HIGHEST_ELEVATION, Math.max(LOWEST_ELEVATION, natural));
  return normalised(
    sum(
      scaled(upward, Math.sin(elevation)),
      scaled(sum(scaled(front, Math.cos(azimuth)), scaled(right, Math.sin(azimuth))), Math.cos(elevation)),
    ),
  );
}

/** Some vertices of every part of the scene. */
export function samplePoints(geometries: readonly GeometrySummary[], wanted = 3000): Vec3[] {
  const available = geometries.reduce((n, { sample }) => n + sample.length / 3, 0);
  const points: Vec3[] = [];
  const stride = Math.max(1, Math.floor(available / wanted)) * 3;
  for (const { sample } of geometries) {
    for (let i = 0; i + 2 < sample.length; i += stride) points.push([sample[i]!, sample[i + 1]!, sample[i + 2]!]);
  }
  return points;
}

export function corners({ min, max }: Bounds): Vec3[] {
  return Array.from({ length: 8 }, (_, corner) => [
    (corner & 1 ? max : min)[0],
    (corner & 2 ? max : min)[1],
    (corner & 4 ? max : min)[2],
  ]);
}

function middle(values: number[]): number {
  return values.sort((a, b) => a - b)[values.length >> 1] ?? 0;
}

/**
 * The points without strays: within `core` where the server says where the scene is, and otherwise without a few that lie beyond a gap
 * wider than all the others reach.
 */
export function withoutStrays(points: Vec3[], core: Bounds | null): Vec3[] {
  if (core !== null) {
    const margin = 0.01 * Math.hypot(...[0, 1, 2].map((axis) => core.max[axis]! - core.min[axis]!));
    const inside = points.filter((point) =>
      point.every((value, axis) => value >= core.min[axis]! - margin && value <= core.max[axis]! + margin),
    );
    return inside.length > 0 ? inside : corners(core);
  }
  const centre: Vec3 = [middle(points.map(([x]) => x)), middle(points.map(([, y]) => y)), middle(points.map(([, , z]) => z))];
  const distance = (point: Vec3) => Math.hypot(point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]);
  const reach = points.map(distance).sort((a, b) => a - b);
  const first = Math.max(1, Math.floor(points.length * (1 - MOST_STRAYS)));
  for (let i = first; i < reach.length; i += 1) {
    const before = reach[i - 1]!;
    if (before > 0 && reach[i]! > STRAY_GAP * before) return points.filter((point) => distance(point) <= before);
  }
  return points;
}

function extentAlong(points: readonly Vec3[], axis: Vec3): number {
  let least = Infinity;
  let most = -Infinity;
  for (const point of points) {
    const at = dot(point, axis);
    least = Math.min(least, at);
    most = Math.max(most, at);
  }
  return most - least;
}

/** Screen space that controls cover, as shares of the width and height. */
export interface Insets {
  left: number;
  right: number;
  top: number;
  bottom: number;
}

/**
 * The closest view along `direction` (from the target to the eye) that has the points in the free part of the picture. The target
 * is the point of the scene in the middle of the whole picture.
 */
export function fittedView(
  points: readonly Vec3[],
  direction: Vec3,
  up: UpAxis,
  fov_y_rad: number,
  aspect: number,
  insets: Insets = { left: 0, right: 0, top: 0, bottom: 0 },
): View {
  const backward = normalised(direction);
  const right = normalised(cross(UP[up], backward));
  const upward = cross(backward, right);
  const tanY = Math.tan(fov_y_rad / 2);
  const tanX = tanY * aspect;
  // Slopes of the free part's edges: a point at depth d is inside when left d <= x <= right d.
  const edges = {
    left: tanX * (2 * insets.left - 1),
    right: tanX * (1 - 2 * insets.right),
    bottom: tanY * (2 * insets.bottom - 1),
    top: tanY * (1 - 2 * insets.top),
  };
  // In the camera's frame with depth measured from the scene's origin: x - edge * depth must lie on one side of the eye's.
  const bound = (axis: Vec3, edge: number, side: 1 | -1): number => {
    const values = points.map((point) => side * (dot(point, axis) + edge * dot(point, backward))).sort((a, b) => a - b);
    return side * (values[Math.max(0, Math.ceil(values.length * (1 - TRIMMED / 8)) - 1)] ?? 0);
  };
  // For an eye at (ex, ey, ez): x - ex <= right (ez - z)  <=>  x + right z <= ex + right ez, and so on.
  const r = bound(right, edges.right, 1);
  const l = bound(right, edges.left, -1);
  const t = bound(upward, edges.top, 1);
  const b = bound(upward, edges.bottom, -1);
  const ez = Math.max((r - l) / (edges.right - edges.left), (t - b) / (edges.top - edges.bottom));
  const ex = (r - edges.right * ez + (l - edges.left * ez)) / 2;
  const ey = (t - edges.top * ez + (b - edges.bottom * ez)) / 2;
  const depths = points.map((point) => dot(point, backward)).sort((p, q) => p - q);
  const middle = depths[Math.floor(depths.length / 2)] ?? 0;
  const nearest = depths[Math.max(0, Math.ceil(depths.length * (1 - TRIMMED)) - 1)] ?? 0;
  const spread = Math.max(...[right, upward, backward].map((axis) => extentAlong(points, axis)));
  const isPlace = spread <= 1e-9 * Math.hypot(...(points[0] ?? [0, 0, 0]));
  const eyeDepth = Math.max(ez, nearest + (isPlace ? EXTENT_OF_A_PLACE / tanY : 1e-6));
  const eye = sum(sum(scaled(right, ex), scaled(upward, ey)), scaled(backward, eyeDepth));
  const distance = Math.max(eyeDepth - middle, 1e-6);
  return { eye, target: sum(eye, scaled(backward, -distance)) };
}
