import type { TileSet } from '../tiles/tile_set';
import type { Store } from './store.svelte';

type What = Pick<Store, 'settled' | 'fusingPlace' | 'hatchAbove_kelvin' | 'methods' | 'server'>;

/** What has not come for so long does not come: it may be of a tile out of view that is drawn still, or could not be made. */
const GIVEN_UP_MS = 30_000;

/** Whether much may be on its way from the server: for so long a silent link is given more time. */
export class Expectation {
  #lacking = 0;
  #lackingSince = 0;

  constructor(
    private readonly store: What,
    private readonly tiles: Pick<TileSet, 'lackingSigma'>,
    private readonly now: () => number = () => performance.now(),
  ) {}

  isMuch(): boolean {
    const { settled, fusingPlace, methods } = this.store;
    return !settled || fusingPlace === 'coming' || methods.length === 0 || this.#isSigmaComing();
  }

  #isSigmaComing(): boolean {
    const { hatchAbove_kelvin, server } = this.store;
    const isAsked = hatchAbove_kelvin !== null && server?.capabilities.includes('temperature_sigma') === true;
    const lacking = isAsked ? this.tiles.lackingSigma() : 0;
    if (lacking !== this.#lacking) this.#lackingSince = this.now();
    this.#lacking = lacking;
    return lacking > 0 && this.now() - this.#lackingSince < GIVEN_UP_MS;
  }
}
