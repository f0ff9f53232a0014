import { type FusingWish, LONGEST_RAW_S, type Unfit } from '../state/fusing';
import type { FusingPlace } from '../state/store.svelte';
import type { TileCosts } from '../tiles/tile_set';
import { bytes, duration } from './format';

export interface FusingFacts {
  place: FusingPlace;
  wish: FusingWish;
  /** There is a library here, and raw layers are given. */
  isPossible: boolean;
  problem: string | null;
  /** Why automatic stays with the robot; null: it does not. */
  unfit: Unfit | null;
  /** The library here is ready. */
  hasLibrary: boolean;
  /** Bytes of what the robot had to count for settings of this method. */
  counted_bytes: number | null;
  /** Of the drawn tiles whose raw layers are here. */
  share: number;
  costs: TileCosts;
  /** Bytes per second over this link; null: not measured yet. */
  rate: number | null;
}

/** What is said of where colours are made, and what either costs on this link. */
export function fusingWords(facts: FusingFacts): { now: string; cost: string } {
  const { costs, rate, counted_bytes } = facts;
  const time = (seconds: number) => (seconds < 1 ? 'under 1 s' : duration(seconds));
  const cost = (size: number) => `${bytes(size)}${rate === null ? '' : `, ${time(size / rate)}`}`;
  const setting =
    counted_bytes === null ? 'nothing for a setting' : `for a setting what the robot counts, ${cost(counted_bytes)}`;
  return {
    now: nowWords(facts),
    cost: `Here: about ${cost(costs.raw_bytes)} once, ${setting}. On the robot: up to ${cost(costs.change_bytes)} for each.`,
  };
}

function nowWords({ place, wish, isPossible, problem, unfit, hasLibrary, counted_bytes, share }: FusingFacts): string {
  if (problem !== null) return place === 'here' ? `Here until the robot has made it: ${problem}` : `On the robot: ${problem}`;
  if (place === 'here')
    return counted_bytes === null ? 'Here: a setting needs no link.' : 'Here; for some settings the robot counts.';
  if (place === 'coming' && share === 1 && !hasLibrary) return 'On the robot, until the library for colours is here.';
  if (place === 'coming') return `On the robot, until raw values of everything are here: ${Math.round(share * 100)} %.`;
  if (!isPossible && wish !== 'robot') return 'On the robot: it gives no raw values, or this page has no library for them.';
  if (wish === 'automatic' && unfit === 'machine') return 'On the robot: this machine is small.';
  if (wish === 'automatic' && unfit === 'map') return 'On the robot, as long as the map grows.';
  if (wish === 'automatic' && unfit === 'link')
    return `On the robot: raw values would take longer than ${duration(LONGEST_RAW_S)}.`;
  return wish === 'here' ? 'On the robot, until its picture is complete.' : 'On the robot.';
}
