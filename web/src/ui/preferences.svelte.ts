/** What a person has chosen about the controls themselves; kept in this browser. */

export type Scheme = 'dark' | 'light';

interface Kept {
  letterKeys: boolean;
  scheme: Scheme;
}

const PLACE = 'spectra.preferences';
const DEFAULTS: Kept = { letterKeys: true, scheme: 'dark' };

/** What was kept, with the default for whatever is not there or not readable. */
export function keptPreferences(text: string | null): Kept {
  try {
    const found = JSON.parse(text ?? '{}') as Partial<Record<keyof Kept, unknown>> | null;
    return {
      letterKeys: typeof found?.letterKeys === 'boolean' ? found.letterKeys : DEFAULTS.letterKeys,
      scheme: found?.scheme === 'light' || found?.scheme === 'dark' ? found.scheme : DEFAULTS.scheme,
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
