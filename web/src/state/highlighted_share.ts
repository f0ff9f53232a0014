import type { Highlighting } from '../draw/surface_share';
import { highlightKey } from './fusion_change';
import type { Store } from './store.svelte';

/** What is needed of the picture. */
export interface SharePicture {
  /** All changes are in the picture. */
  readonly isUpToDate: boolean;
  /** What of the surface is highlighted as it is drawn; null where that cannot be said. */
  highlighting(): Promise<Highlighting | null>;
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
    /** Colours of what is shown now, as a tile's, by which it is judged whether highlights stand out. */
    private readonly onColours: (rgba: Uint8Array) => void,
  ) {}

  /** Other temperatures are highlighted now, or are about to be. `method` is what highlights them. */
  changed(method: string, highlighted: [number, number][]): void {
    const { store } = this;
    this.#number += 1;
    clearTimeout(this.#timer);
    if (store.histogram === null) return;
    if (highlighted.length > 0) store.highlighting[method] = true;
    // Until the picture says it, that of before is kept: whoever shows it looks whether it is of what is set.
    const { highlighted_share: before, ...rest } = store.histogram;
    const isKept = store.highlighting[method] !== undefined && before !== undefined;
    store.histogram = { ...rest, highlighted, ...(isKept ? { highlighted_share: before } : {}) };
    this.#look(method);
  }

  dispose(): void {
    this.#number += 1;
    clearTimeout(this.#timer);
  }

  /** No temperature is highlighted, nor is any beyond the sensor's range: the steps that temperatures come in may put a few on the wrong side. */
  #isNothing(highlighted: readonly unknown[]): boolean {
    const { over_range_count = 0, under_range_count = 0 } = this.store.scene?.temperature ?? {};
    return highlighted.length === 0 && over_range_count + under_range_count === 0;
  }

  #look(method: string): void {
    const number = this.#number;
    this.#timer = setTimeout(() => void this.#read(method, number), LOOK_MS);
  }

  async #read(method: string, number: number): Promise<void> {
    const { store } = this;
    if (!this.picture.isUpToDate) return this.#look(method);
    const found = store.fusingPlace === 'here' ? await this.picture.highlighting() : null;
    if (number !== this.#number || store.fusingPlace !== 'here' || store.histogram === null) return;
    const { highlighted_share: _before, ...rest } = store.histogram;
    const isSaid = found !== null && store.highlighting[method] !== undefined;
    store.histogram = isSaid ? { ...rest, highlighted_share: this.#isNothing(rest.highlighted) ? 0 : found.share } : rest;
    store.shareOf = store.fusionInForce === null ? null : highlightKey(store.fusionInForce);
    if (found !== null) this.onColours(found.colours);
  }
}
