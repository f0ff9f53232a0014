import type { Store } from './store.svelte';

/** What is needed of the picture. */
export interface SharePicture {
  /** All changes are in the picture. */
  readonly isUpToDate: boolean;
  /** How much of the surface is highlighted as it is drawn; null where that cannot be said. */
  highlightedShare(): Promise<number | null>;
}

/** The picture follows within so long. */
const LOOK_MS = 60;

/**
 * How much of the surface a method highlights where colours are made here: the robot, which would say it, does not know the settings.
 * A method is known to highlight by having done so, or by the robot's word.
 */
export class HighlightedShare {
  #timer: ReturnType<typeof setTimeout> | undefined;
  #number = 0;

  constructor(
    private readonly store: Store,
    private readonly picture: SharePicture,
  ) {}

  /** Other temperatures are highlighted now, or are about to be. `method` is what highlights them. */
  changed(method: string, highlighted: [number, number][]): void {
    const { store } = this;
    this.#number += 1;
    clearTimeout(this.#timer);
    if (store.histogram === null) return;
    if (highlighted.length > 0) store.highlighting[method] = true;
    const { highlighted_share: before, ...rest } = store.histogram;
    if (store.highlighting[method] === undefined) {
      store.histogram = { ...rest, highlighted };
      return;
    }
    // Until the picture says it, that of before stands, as it does while the robot is asked.
    store.histogram = { ...rest, highlighted, ...(before === undefined ? {} : { highlighted_share: before }) };
    this.#look();
  }

  dispose(): void {
    this.#number += 1;
    clearTimeout(this.#timer);
  }

  #look(): void {
    const number = this.#number;
    this.#timer = setTimeout(() => void this.#read(number), LOOK_MS);
  }

  async #read(number: number): Promise<void> {
    const { store } = this;
    if (!this.picture.isUpToDate) return this.#look();
    const share = store.fusingPlace === 'here' ? await this.picture.highlightedShare() : null;
    if (number !== this.#number || store.fusingPlace !== 'here' || store.histogram === null) return;
    const { highlighted_share: _before, ...rest } = store.histogram;
    store.histogram = share === null ? rest : { ...rest, highlighted_share: share };
  }
}
