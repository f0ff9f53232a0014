/** What a person has chosen about the controls themselves; kept in this browser. */

import type { FusingWish } from '../state/fusing';
import type { OutlineWish } from '../state/store.svelte';

export type Scheme = 'dark' | 'light';

interface Kept {
  letterKeys: boolean;
  scheme: Scheme;
  outline: OutlineWish;
  fusing: FusingWish;
}

const PLACE = 'spectra.preferences';
const DEFAULTS: Kept = { letterKeys: true, scheme: 'dark', outline: 'automatic', fusing: 'automatic' };

/** What was kept, with the default for whatever is not there or not readable. */
export function keptPreferences(text: string | null): Kept {
  try {
    const found = JSON.parse(text ?? '{}') as Partial<Record<keyof Kept, unknown>> | null;
    return {
      letterKeys: typeof found?.letterKeys === 'boolean' ? found.letterKeys : DEFAULTS.letterKeys,
      scheme: found?.scheme === 'light' || found?.scheme === 'dark' ? found.scheme : DEFAULTS.scheme,
      outline: found?.outline === 'on' || found?.outline === 'off' ? found.outline : DEFAULTS.outline,
      fusing: found?.fusing === 'here' || found?.fusing === 'robot' ? found.fusing : DEFAULTS.fusing,
    };
  } catch {
    return DEFAULTS;
  }
}

class Preferences {
  #kept = $state<Kept>(DEFAULTS);

  constructor() {
    // A browser may forbid its store: then the choice lasts as long as the page.
    try {
      this.#kept = keptPreferences(localStorage.getItem(PLACE));
    } catch {
      this.#kept = DEFAULTS;
    }
  }

  /** Single keys without a modifier act. */
  get letterKeys(): boolean {
    return this.#kept.letterKeys;
  }
  set letterKeys(letterKeys: boolean) {
    this.#keep({ ...this.#kept, letterKeys });
  }

  /** Of the controls; the scene has a background of its own. */
  get scheme(): Scheme {
    return this.#kept.scheme;
  }
  set scheme(scheme: Scheme) {
    this.#keep({ ...this.#kept, scheme });
  }

  /** A line around what is highlighted. */
  get outline(): OutlineWish {
    return this.#kept.outline;
  }
  set outline(outline: OutlineWish) {
    this.#keep({ ...this.#kept, outline });
  }

  /** Where colours are made. */
  get fusing(): FusingWish {
    return this.#kept.fusing;
  }
  set fusing(fusing: FusingWish) {
    this.#keep({ ...this.#kept, fusing });
  }

  #keep(kept: Kept): void {
    this.#kept = kept;
    try {
      localStorage.setItem(PLACE, JSON.stringify(kept));
    } catch {
      // As above.
    }
  }
}

export const preferences = new Preferences();
