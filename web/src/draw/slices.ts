/** Longest that the GPU is to be kept busy by one part of a picture: whatever else wants it, input among it, waits no longer. */
const SLICE_MS = 20;
/** Triangles or points of the first part, before it is known how fast the machine is. */
const FIRST_BUDGET = 40_000;
const LEAST_BUDGET = 2_000;
/** From a part to the next one its size changes by no more than this. */
const MOST_GROWTH = 4;

/** A run of the triangles, or points, of one object. */
export interface Part {
  object: number;
  start: number;
  count: number;
}

/** Cuts what is to be drawn, so many triangles or points an object, into parts. */
export class Slices {
  #object = 0;
  #start = 0;

  constructor(private readonly sizes: readonly number[]) {}

  get isDone(): boolean {
    return this.#object >= this.sizes.length;
  }

  /** The next `budget` of them. */
  next(budget: number): Part[] {
    const parts: Part[] = [];
    for (let left = budget; left > 0 && !this.isDone;) {
      const size = this.sizes[this.#object]!;
      const count = Math.min(left, size - this.#start);
      if (count > 0) parts.push({ object: this.#object, start: this.#start, count });
      left -= count;
      this.#start += count;
      if (this.#start < size) continue;
      this.#object += 1;
      this.#start = 0;
    }
    return parts;
  }
}

/** Finds how large the parts of a picture may be, by what they take. */
export class SlicePace {
  #budget = FIRST_BUDGET;

  get budget(): number {
    return this.#budget;
  }

  /** So many took so long, until the GPU was through with them. */
  took(count: number, ms: number): void {
    // A picture of nothing tells what clearing takes.
    if (count === 0) return;
    const wanted = (count * SLICE_MS) / Math.max(1, ms);
    // A small rest of a picture tells that a larger part takes longer, not how much.
    if (count < this.#budget && wanted < this.#budget && ms < SLICE_MS) return;
    this.#budget = Math.round(Math.max(LEAST_BUDGET, this.#budget / MOST_GROWTH, Math.min(this.#budget * MOST_GROWTH, wanted)));
  }
}
