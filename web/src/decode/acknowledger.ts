/** Turns "these frames are decoded", in any order, into "everything up to here is decoded", which is what stream.ack says. */
export class Acknowledger {
  #acknowledged = 0;
  #done = new Set<number>();

  constructor(private readonly acknowledge: (sequence: number) => void) {}

  /** Everything up to this sequence is decoded. */
  get sequence(): number {
    return this.#acknowledged;
  }

  /** Frame `sequence` needs no further work. */
  finished(sequence: number): void {
    if (sequence <= this.#acknowledged) return;
    this.#done.add(sequence);
    let next = this.#acknowledged;
    while (this.#done.delete(next + 1)) next += 1;
    if (next === this.#acknowledged) return;
    this.#acknowledged = next;
    this.acknowledge(next);
  }

  /** A new connection counts from 1 again. */
  reset(): void {
    this.#acknowledged = 0;
    this.#done.clear();
  }
}
