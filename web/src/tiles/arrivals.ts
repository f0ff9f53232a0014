import type { DecodeResult } from '../decode/messages';
import { type TileFrame, type TileId, tileKey } from '../protocol/frame';
import type { TileSet } from './tile_set';

interface Arrival {
  frame: TileFrame;
  result: DecodeResult;
  /** When it, or a predecessor that waited in its place, was decoded. */
  since: number;
  /** Of the first of them. */
  firstSequence: number;
}

/** Longest time for which a coarse answer waits for the finer one behind it. */
export const LONGEST_WAIT_MS = 80;

/**
 * Decoded tiles on their way into the picture, the newest per tile and kind. Each picture takes as many as it can without being late.
 *
 * A coarse tile in newer colours hides the older detail that stands in its place (see TileSet). Where the detail in the same colours
 * follows at once that would only flicker, so the coarse tile lets everything else that is decoded go first, and, as long as detail
 * has been following within LONGEST_WAIT_MS, waits for it that long.
 */
export class Arrivals {
  #waiting = new Map<string, Arrival>();
  /** Coarse tiles that hide older detail, and when their colours were decoded. */
  #hiding = new Map<string, { tile: TileId; since: number }>();
  #isDetailQuick = true;

  /** `onProblem` is told of tiles that do not fit together; they are left out. */
  constructor(
    private readonly tiles: TileSet,
    private readonly onProblem: (error: unknown) => void,
  ) {}

  get size(): number {
    return this.#waiting.size;
  }

  /** That of the oldest frame of which something has not been brought in. */
  get oldestSequence(): number {
    return Math.min(...[...this.#waiting.values()].map(({ firstSequence }) => firstSequence));
  }

  add(frame: TileFrame, result: DecodeResult, now: number): void {
    const key = `${result.kind} ${tileKey(frame.tile)}`;
    const older = this.#waiting.get(key);
    if (older !== undefined && older.frame.sequence > frame.sequence) return;
    this.#waiting.set(key, { frame, result, since: older?.since ?? now, firstSequence: older?.firstSequence ?? frame.sequence });
  }

  /** What has not been brought in of a tile is not wanted any more. */
  drop(tile: TileId): void {
    const key = tileKey(tile);
    this.#waiting.delete(`geometry ${key}`);
    for (const kind of ['colours', 'temperature', 'visible', 'sigma']) this.#waiting.delete(`${kind} ${key}`);
    this.#hiding.delete(key);
  }

  clear(): void {
    this.#waiting.clear();
    this.#hiding.clear();
  }

  /**
   * Hands tiles to the tile set until `budget_bytes` are used up; `isLast` says that nothing follows what is here. Returns the bytes,
   * and after how many milliseconds there is more to hand over: 0 = in the next picture, null = not before something comes.
   */
  bringIn(now: number, budget_bytes: number, isLast: boolean): { bytes: number; next_ms: number | null } {
    let bytes = 0;
    let next_ms: number | null = null;
    const postponed: [string, Arrival][] = [];
    for (const [key, arrival] of this.#waiting) {
      if (bytes >= budget_bytes) return { bytes, next_ms: 0 };
      if (now - arrival.since < LONGEST_WAIT_MS && this.#hidesDetail(arrival)) postponed.push([key, arrival]);
      else bytes += this.#handOver(key, arrival, now);
    }
    this.#learn(now);
    // From fine to coarse, so that a tile between does not keep the one above it waiting.
    for (const [key, arrival] of postponed.sort(([, a], [, b]) => b.frame.tile.level - a.frame.tile.level)) {
      if (bytes >= budget_bytes) return { bytes, next_ms: 0 };
      if (!isLast && this.#isDetailQuick && this.#hidesDetail(arrival)) {
        const left_ms = arrival.since + LONGEST_WAIT_MS - now;
        next_ms = Math.min(next_ms ?? left_ms, left_ms);
      } else {
        bytes += this.#handOver(key, arrival, now);
      }
    }
    return { bytes, next_ms };
  }

  #hidesDetail({ frame, result }: Arrival): boolean {
    return result.kind === 'colours' && this.tiles.wouldHideDetail(frame);
  }

  #handOver(key: string, arrival: Arrival, now: number): number {
    const { frame, result, since } = arrival;
    const place = tileKey(frame.tile);
    this.#waiting.delete(key);
    if (this.#hidesDetail(arrival)) {
      if (now - since >= LONGEST_WAIT_MS) this.#isDetailQuick = false;
      this.#hiding.set(place, { tile: frame.tile, since });
    } else if (result.kind === 'colours') {
      const hiding = this.#hiding.get(place);
      if (hiding !== undefined) hiding.since = since;
    }
    try {
      if (result.kind === 'geometry') {
        this.tiles.addGeometry(frame, result);
        return result.positions.byteLength + (result.indices?.byteLength ?? 0);
      }
      if (result.kind === 'colours') {
        this.tiles.addColours(frame, result.rgba);
        return result.rgba.byteLength;
      }
      if (result.kind === 'sigma') {
        this.tiles.addSigma(frame, result);
        return result.codes.byteLength;
      }
      this.tiles.addRaw(frame, result);
      return result.kind === 'visible' ? result.rgb.byteLength : result.codes.byteLength;
    } catch (error) {
      this.onProblem(error);
      return 0;
    }
  }

  /** How soon detail came back behind a coarse answer tells whether it is worth waiting for the next time. */
  #learn(now: number): void {
    for (const [key, { tile, since }] of this.#hiding) {
      if (!this.tiles.isReplaced(tile)) continue;
      this.#hiding.delete(key);
      this.#isDetailQuick = now - since <= LONGEST_WAIT_MS;
    }
  }
}
