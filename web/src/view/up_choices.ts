import { type Bounds, UP_AXES, type UpAxis } from './first_view';

const KEY = 'spectra.up';
/** Scenes whose choice is remembered; the oldest is forgotten first. */
const MOST_SCENES = 50;

type Entry = [scene: string, up: UpAxis];

/** Which way is up in a scene, as the user of this browser has chosen it. */
export class UpChoices {
  constructor(private readonly storage: Pick<Storage, 'getItem' | 'setItem'> | null = browserStorage()) {}

  get(name: string, bounds: Bounds): UpAxis | null {
    const scene = sceneKey(name, bounds);
    return this.#entries().find(([key]) => key === scene)?.[1] ?? null;
  }

  /** Null: as the server says. */
  set(name: string, bounds: Bounds, up: UpAxis | null): void {
    const scene = sceneKey(name, bounds);
    const others = this.#entries().filter(([key]) => key !== scene);
    const entries: Entry[] = up === null ? others : [...others, [scene, up]];
    try {
      this.storage?.setItem(KEY, JSON.stringify(entries.slice(-MOST_SCENES)));
    } catch {
      // Full, or forbidden: the choice then holds as long as this page does.
    }
  }

  /** Whatever else has got there is as good as nothing. */
  #entries(): Entry[] {
    try {
      const stored: unknown = JSON.parse(this.storage?.getItem(KEY) ?? '[]');
      return Array.isArray(stored) ? stored.filter(isEntry) : [];
    } catch {
      return [];
    }
  }
}

/** Scenes of one name and place are the same, though a few more vertices may have come. */
function sceneKey(name: string, { min, max }: Bounds): string {
  return `${name} ${[...min, ...max].map((value) => Number(value.toPrecision(3))).join(' ')}`;
}

function isEntry(entry: unknown): entry is Entry {
  return (
    Array.isArray(entry) &&
    entry.length === 2 &&
    typeof entry[0] === 'string' &&
    (UP_AXES as readonly unknown[]).includes(entry[1])
  );
}

function browserStorage(): Storage | null {
  try {
    return localStorage;
  } catch {
    return null;
  }
}
