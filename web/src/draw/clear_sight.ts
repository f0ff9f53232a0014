import type { Vec3 } from '../protocol/messages';
import { nearestHit } from './picking';
import type { TileArrays } from './render_messages';

export interface SightWish {
  /** What is to be seen: a place on a surface. */
  target: Vec3;
  /** From how far away, metres, where nothing is in between. */
  distance: number;
  /** What is nearer to the target than this is the surface that it lies on. */
  tolerance: number;
  /** Where the camera would best stand as seen from the target, of length 1. */
  preferred: Vec3;
}

const DIRECTIONS = 160;
/** How much a preferred side counts against being able to stand as far away as wished. */
const PREFERENCE = 0.3;
/** How much it counts that the surface faces the eye: along its edge a place is seen, and cannot be read. */
const FACING = 1;
/** Share of the free way that is gone back: nearer to what is behind the camera than that, it would be in it. */
const FREE_SHARE = 0.7;
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** Directions spread evenly over the sphere. */
function direction(index: number): Vec3 {
  const z = 1 - (2 * index + 1) / DIRECTIONS;
  const ring = Math.sqrt(1 - z * z);
  return [ring * Math.cos(index * GOLDEN_ANGLE), z, ring * Math.sin(index * GOLDEN_ANGLE)];
}

/**
 * A place from which the target is seen with nothing in between: at the wished distance if it can be, and nearer where surfaces
 * stand close around it. Null when it is walled in.
 */
export function clearSight(geometries: readonly Omit<TileArrays, 'rgba'>[], wish: SightWish): Vec3 | null {
  const { target, distance, tolerance, preferred } = wish;
  const wanted = distance / FREE_SHARE;
  const ways: { way: Vec3; free: number }[] = [];
  for (let i = -1; i < DIRECTIONS; i += 1) {
    const way = i < 0 ? preferred : direction(i);
    const origin = target.map((value, axis) => value + way[axis]! * tolerance) as Vec3;
    // No surface has to be looked for beyond that.
    const hit = nearestHit(geometries, { origin, direction: way }, 0, wanted - tolerance);
    const free = hit === null ? wanted : hit + tolerance;
    if (free >= 2 * tolerance) ways.push({ way, free });
  }
  // The middle of what is free is where the surface faces to; nowhere, where both of its sides are.
  const all = ways.reduce((sum, { free }) => sum + free, 0);
  const middle = [0, 1, 2].map((axis) => ways.reduce((sum, { way, free }) => sum + way[axis]! * free, 0) / all);
  let best: { score: number; way: Vec3; free: number } | null = null;
  for (const { way, free } of ways) {
    const towards = (other: readonly number[]) => way.reduce((sum, value, axis) => sum + value * other[axis]!, 0);
    const score = free / wanted + PREFERENCE * towards(preferred) + FACING * towards(middle);
    if (best === null || score > best.score) best = { score, way, free };
  }
  if (best === null) return null;
  const { way, free } = best;
  return target.map((value, axis) => value + way[axis]! * free * FREE_SHARE) as Vec3;
}
