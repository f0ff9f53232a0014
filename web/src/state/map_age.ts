/**
 * How long ago the newest part of a live map was seen: by the times of whoever saw it, and this machine's clock. Where that is found to
 * be behind, because something has been seen that is still to come, it is put right by as much; nothing tells that it is ahead, and then
 * ages are told too large rather than too small. A time that the map takes back says nothing about the clock any more.
 */
export class MapAge {
  #newest_s: number | null = null;
  #behind_s = 0;

  /** The map says when its newest part was seen (Unix seconds); null: of none that is known. */
  newestIs(newest_s: number | null, now_s: number): void {
    const isTakenBack = this.#newest_s !== null && (newest_s ?? -Infinity) < this.#newest_s;
    if (isTakenBack) this.#behind_s = 0;
    this.#newest_s = newest_s;
    if (newest_s !== null) this.#behind_s = Math.max(this.#behind_s, newest_s - now_s);
  }

  /** The time that whoever sees the map has, Unix seconds. */
  clock(now_s: number): number {
    return now_s + this.#behind_s;
  }

  /** Seconds; null where nothing is known. */
  at(now_s: number): number | null {
    return this.#newest_s === null ? null : Math.max(0, this.clock(now_s) - this.#newest_s);
  }
}
