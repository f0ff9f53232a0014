import type { DecodeJob } from '../decode/messages';
import { type DecodePool, Superseded } from '../decode/pool';
import { FrameKind, type TileFrame, tileKey } from '../protocol/frame';
import type { StreamComplete, StreamStats } from '../protocol/messages';
import { Acknowledger } from '../decode/acknowledger';
import { Arrivals } from './arrivals';
import { RawMismatch, type TileSet } from './tile_set';

/** Most bytes of decoded tiles brought into one picture, so that no picture takes long. */
const BYTES_PER_PICTURE = 4 * 1024 * 1024;

/** What the picture shows of a scene that changes. */
export type Shown = Pick<StreamStats, 'generation' | 'scene_revision'>;

export interface FrameIntakeEvents {
  /** Every frame up to this one is decoded. */
  onDecoded: (sequence: number) => void;
  /** There is something for the next picture. */
  onArrival: () => void;
  /** New colours of the coarsest tile there can be, which shows all of the scene. */
  onWholeColours: (rgba: Uint8Array) => void;
  /** A frame that could not be decoded, or does not fit to the others; it is left out. */
  onProblem: (error: unknown) => void;
  /** The same of a raw layer. */
  onRawProblem: (message: string) => void;
}

/** The way of tile frames from the connection through the decoder into the tile set. */
export class FrameIntake {
  readonly #acknowledger: Acknowledger;
  readonly #arrivals: Arrivals;
  /** Sequence of the frame that removed a tile: what was sent of it before may be decoded later. */
  #removedAt = new Map<string, number>();
  #connectionNumber = 0;
  /** Of the tile that stands for all there is: the coarsest that has come. */
  #topLevel = Infinity;
  #lastSequence = 0;
  #completeAfter: { sequence: number; message: StreamComplete } | null = null;
  /** The oldest that is waited for, and the newest: a hidden page draws nothing, and hears all the same. */
  #shownAfter: { sequence: number; shown: Shown }[] = [];

  constructor(
    private readonly tiles: TileSet,
    private readonly pool: Pick<DecodePool, 'decode' | 'clear' | 'dispose'>,
    private readonly events: FrameIntakeEvents,
  ) {
    this.#acknowledger = new Acknowledger(events.onDecoded);
    this.#arrivals = new Arrivals(tiles, (error) => this.#failed(error));
  }

  /** Frames count from 1 again, and what is still on its way from the connection before is not wanted any more. */
  beginConnection(): void {
    this.#connectionNumber += 1;
    this.#topLevel = Infinity;
    this.#acknowledger.reset();
    this.pool.clear();
    this.#arrivals.clear();
    this.#removedAt.clear();
    this.#lastSequence = 0;
    this.#completeAfter = null;
    this.#shownAfter = [];
    this.tiles.beginConnection();
  }

  dispose(): void {
    this.pool.dispose();
  }

  receive(frame: TileFrame): void {
    this.#lastSequence = frame.sequence;
    const key = tileKey(frame.tile);
    if (frame.kind === FrameKind.remove) {
      if (frame.tile.level === this.#topLevel) this.#topLevel = Infinity;
    } else {
      this.#topLevel = Math.min(this.#topLevel, frame.tile.level);
    }
    if (frame.kind === FrameKind.geometry) {
      this.#decode(`geometry ${key}`, frame, { kind: 'geometry', payload: frame.payload, origin_m: frame.origin_m });
    } else if (frame.kind === FrameKind.colours || frame.kind === FrameKind.colours_subtract_green) {
      const transform = frame.kind === FrameKind.colours ? 'none' : 'subtract_green';
      this.#decode(`colours ${key}`, frame, { kind: 'colours', payload: frame.payload, transform });
    } else if (frame.kind === FrameKind.temperature) {
      this.#decode(`temperature ${key}`, frame, { kind: 'temperature', payload: frame.payload });
    } else if (frame.kind === FrameKind.temperature_sigma) {
      this.#decode(`sigma ${key}`, frame, { kind: 'sigma', payload: frame.payload });
    } else if (frame.kind === FrameKind.visible || frame.kind === FrameKind.visible_subtract_green) {
      const transform = frame.kind === FrameKind.visible ? 'none' : 'subtract_green';
      this.#decode(`visible ${key}`, frame, { kind: 'visible', payload: frame.payload, transform });
    } else {
      if (frame.kind === FrameKind.remove) {
        this.#removedAt.set(key, frame.sequence);
        this.#arrivals.drop(frame.tile);
        this.tiles.remove(frame.tile);
        this.events.onArrival();
      }
      this.#acknowledger.finished(frame.sequence);
    }
  }

  /** All that has come has been decoded and brought in. */
  get isTakenIn(): boolean {
    return this.#acknowledger.sequence >= this.#lastSequence && this.#arrivals.size === 0;
  }

  /** The server has sent all that was asked for; bringIn() says when that is in the picture. */
  completeAfterAll(message: StreamComplete): void {
    this.#completeAfter = { sequence: this.#lastSequence, message };
    this.events.onArrival();
  }

  /** The server has sent all that had changed by a revision; bringIn() says, with the next picture, when that is in it. */
  shownAfterAll(shown: Shown): void {
    const last = this.#shownAfter.at(-1)?.shown;
    if (last?.generation === shown.generation && last.scene_revision === shown.scene_revision) return;
    this.#shownAfter = [...this.#shownAfter.slice(0, 1), { sequence: this.#lastSequence, shown }];
  }

  /**
   * Brings decoded tiles into the tile set, as many as one picture can take: how many bytes, after how many milliseconds there is more
   * (see Arrivals.bringIn), and the completion and the revision that are reached with them.
   */
  bringIn(now: number): { bytes: number; next_ms: number | null; complete: StreamComplete | null; shown: Shown | null } {
    const last = this.#completeAfter;
    const isLast = last !== null && this.#acknowledger.sequence >= last.sequence;
    const { bytes, next_ms } = this.#arrivals.bringIn(now, BYTES_PER_PICTURE, isLast);
    const isIn = (sequence: number) => this.#acknowledger.sequence >= sequence && this.#arrivals.oldestSequence > sequence;
    const shown = this.#shownAfter.filter(({ sequence }) => isIn(sequence)).at(-1)?.shown ?? null;
    this.#shownAfter = this.#shownAfter.filter(({ sequence }) => !isIn(sequence));
    if (!isLast || this.#arrivals.size > 0) return { bytes, next_ms, complete: null, shown };
    this.#completeAfter = null;
    return { bytes, next_ms, complete: last.message, shown };
  }

  #failed(error: unknown): void {
    if (error instanceof RawMismatch) this.events.onRawProblem(error.message);
    else this.events.onProblem(error);
  }

  #decode(key: string, frame: TileFrame, job: DecodeJob): void {
    const connectionNumber = this.#connectionNumber;
    this.pool
      .decode(key, job)
      .then((result) => {
        if (connectionNumber !== this.#connectionNumber) return;
        const removed = this.#removedAt.get(tileKey(frame.tile)) ?? 0;
        if (result.kind === 'colours' && frame.tile.level === this.#topLevel) this.events.onWholeColours(result.rgba);
        if (frame.sequence > removed) this.#arrivals.add(frame, result, performance.now());
        this.events.onArrival();
      })
      .catch((error: unknown) => {
        if (error instanceof Superseded) return;
        const isRaw = job.kind === 'temperature' || job.kind === 'visible';
        this.#failed(isRaw ? new RawMismatch(`tile ${tileKey(frame.tile)}: ${messageOf(error)}`) : error);
      })
      .finally(() => {
        if (connectionNumber === this.#connectionNumber) this.#acknowledger.finished(frame.sequence);
      });
  }
}

function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
