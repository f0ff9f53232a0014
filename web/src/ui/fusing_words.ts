import { CHANGE_BYTES_PER_VERTEX, type FusingWish, LONGEST_RAW_S, RAW_BYTES_PER_VERTEX } from '../state/fusing';
import type { FusingPlace } from '../state/store.svelte';
import { bytes, duration } from './format';

export interface FusingFacts {
  place: FusingPlace;
  wish: FusingWish;
  /** There is a library here, and raw layers are given. */
  isPossible: boolean;
  problem: string | null;
  /** Of the drawn tiles whose raw layers are here. */
  share: number;
  /** That are drawn. */
  vertices: number;
  /** Bytes per second over this link; null: not measured yet. */
  rate: number | null;
}

/** What is said of where colours are made, and what either costs on this link. */
export function fusingWords({ place, wish, isPossible, problem, share, vertices, rate }: FusingFacts): {
  now: string;
  cost: string;
} {
  const raw = vertices * RAW_BYTES_PER_VERTEX;
  const change = vertices * CHANGE_BYTES_PER_VERTEX;
  const time = (seconds: number) => (seconds < 1 ? 'under 1 s' : duration(seconds));
  const cost = (size: number) => `${bytes(size)}${rate === null ? '' : `, ${time(size / rate)}`}`;
  return {
    now: nowWords(place, wish, isPossible, problem, share),
    cost: `Here: about ${cost(raw)} once, nothing for a setting. On the robot: up to ${cost(change)} for each.`,
  };
}

function nowWords(place: FusingPlace, wish: FusingWish, isPossible: boolean, problem: string | null, share: number): string {
  if (problem !== null) return `On the robot: ${problem}`;
  if (place === 'here') return 'Here: a setting needs no link.';
  if (place === 'coming') return `On the robot, until raw values of everything are here: ${Math.round(share * 100)} %.`;
  if (!isPossible && wish !== 'robot') return 'On the robot: it gives no raw values, or this page has no library for them.';
  if (wish === 'automatic')
    return `On the robot: raw values would take longer than ${duration(LONGEST_RAW_S)}, or this machine is small.`;
  return 'On the robot.';
}
