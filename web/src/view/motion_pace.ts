/** How a picture is drawn while the camera moves. */
export interface Notch {
  /** Share of the screen's resolution, along each side. */
  resolution: number;
  /** Levels of the tile tree that are left out, from the finest. */
  levels: number;
}

/** From full to least: first resolution, then detail, then both. */
const NOTCHES: readonly Notch[] = [
  { resolution: 1, levels: 0 },
  { resolution: 0.7, levels: 0 },
  { resolution: 0.5, levels: 0 },
  { resolution: 0.5, levels: 1 },
  { resolution: 0.5, levels: 2 },
  { resolution: 0.35, levels: 3 },
  { resolution: 0.25, levels: 5 },
];

/** Longest that a picture may take while the camera moves. */
export const LONGEST_MOVING_MS = 50;
/** A machine that is this fast can do better; so many pictures in a row, lest it changes to and fro. */
const EASY_MS = 18;
const EASY_PICTURES = 12;
/** What full pictures take tells how to begin, before the first one while moving has been drawn. */
const FIRST_GUESS_MS = [50, 100, 200, 400, 800] as const;

/** Finds how much a machine can draw while the camera moves, by what its pictures take. */
export class MotionPace {
  #notch = 0;
  /** The best notch that has not been too slow; tried again after a rest only. */
  #limit = 0;
  #easy = 0;
  #hasMoved = false;

  /** How to draw while the camera moves. */
  get moving(): Notch {
    return NOTCHES[this.#notch]!;
  }

  /** A picture has been drawn, while the camera moved (with `notch`) or at rest and in full. */
  drawn(ms: number, notch: Notch | null): void {
    if (notch === null) {
      if (!this.#hasMoved) this.#notch = FIRST_GUESS_MS.filter((limit) => ms > limit).length;
      // The scene or the window may be another one by now.
      this.#limit = 0;
      return;
    }
    this.#hasMoved = true;
    // Drawn before the last change: tells nothing of what is in force.
    if (notch !== this.moving) return;
    if (ms > LONGEST_MOVING_MS) {
      this.#limit = Math.min(NOTCHES.length - 1, this.#notch + 1);
      this.#notch = Math.min(
        NOTCHES.length - 1,
        this.#notch + (ms > 4 * LONGEST_MOVING_MS ? 3 : ms > 2 * LONGEST_MOVING_MS ? 2 : 1),
      );
      this.#easy = 0;
      return;
    }
    this.#easy = ms < EASY_MS ? this.#easy + 1 : 0;
    if (this.#easy < EASY_PICTURES || this.#notch <= this.#limit) return;
    this.#notch -= 1;
    this.#easy = 0;
  }
}
