import type { Vec3 } from '../protocol/messages';
import type { TileArrays } from './render_messages';

export interface Ray {
  origin: Vec3;
  /** Of length 1. */
  direction: Vec3;
}

/**
 * Distance along the ray to the nearest surface, or null. Of a point cloud, the nearest point within `cone` (tangent of the angle
 * between the ray and the point) counts. Nothing is looked for beyond `limit`.
 */
export function nearestHit(
  geometries: Iterable<Omit<TileArrays, 'rgba'>>,
  ray: Ray,
  cone: number,
  limit = Infinity,
): number | null {
  let nearest = limit;
  for (const geometry of geometries) {
    if (!meetsSphere(ray, geometry.centre, geometry.radius, cone, nearest)) continue;
    nearest =
      geometry.indices === null
        ? nearestPoint(geometry.positions, ray, cone, nearest)
        : nearestTriangle(geometry.positions, geometry.indices, ray, nearest);
  }
  return nearest === limit ? null : nearest;
}

function meetsSphere(ray: Ray, centre: Vec3, radius: number, cone: number, nearest: number): boolean {
  const x = centre[0] - ray.origin[0];
  const y = centre[1] - ray.origin[1];
  const z = centre[2] - ray.origin[2];
  const along = x * ray.direction[0] + y * ray.direction[1] + z * ray.direction[2];
  if (along < -radius || along - radius > nearest) return false;
  const reach = radius + Math.max(0, along + radius) * cone;
  return x * x + y * y + z * z - along * along <= reach * reach;
}

/** In parts of an edge: a ray through one that two triangles share is not lost between them by rounding. */
const EDGE_SLACK = 1e-6;

/** Both sides of a triangle count: scans have holes through which backs are seen. */
function nearestTriangle(positions: Float32Array, indices: Uint16Array | Uint32Array, ray: Ray, limit: number): number {
  const [ox, oy, oz] = ray.origin;
  const [dx, dy, dz] = ray.direction;
  let nearest = limit;
  for (let i = 0; i < indices.length; i += 3) {
    const a = indices[i]! * 3;
    const b = indices[i + 1]! * 3;
    const c = indices[i + 2]! * 3;
    const ax = positions[a]!;
    const ay = positions[a + 1]!;
    const az = positions[a + 2]!;
    const e1x = positions[b]! - ax;
    const e1y = positions[b + 1]! - ay;
    const e1z = positions[b + 2]! - az;
    const e2x = positions[c]! - ax;
    const e2y = positions[c + 1]! - ay;
    const e2z = positions[c + 2]! - az;
    const px = dy * e2z - dz * e2y;
    const py = dz * e2x - dx * e2z;
    const pz = dx * e2y - dy * e2x;
    const determinant = e1x * px + e1y * py + e1z * pz;
    if (determinant === 0) continue;
    const tx = ox - ax;
    const ty = oy - ay;
    const tz = oz - az;
    const u = (tx * px + ty * py + tz * pz) / determinant;
    if (u < -EDGE_SLACK || u > 1 + EDGE_SLACK) continue;
    const qx = ty * e1z - tz * e1y;
    const qy = tz * e1x - tx * e1z;
    const qz = tx * e1y - ty * e1x;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (v < -EDGE_SLACK || u + v > 1 + EDGE_SLACK) continue;
    const distance = (e2x * qx + e2y * qy + e2z * qz) / determinant;
    if (distance > 0 && distance < nearest) nearest = distance;
  }
  return nearest;
}

function nearestPoint(positions: Float32Array, ray: Ray, cone: number, limit: number): number {
  let nearest = limit;
  for (let i = 0; i < positions.length; i += 3) {
    const x = positions[i]! - ray.origin[0];
    const y = positions[i + 1]! - ray.origin[1];
    const z = positions[i + 2]! - ray.origin[2];
    const along = x * ray.direction[0] + y * ray.direction[1] + z * ray.direction[2];
    if (along <= 0 || along >= nearest) continue;
    const reach = along * cone;
    if (x * x + y * y + z * z - along * along <= reach * reach) nearest = along;
  }
  return nearest;
}
