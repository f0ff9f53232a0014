import type { Scene, Status } from '../protocol/messages';

/** Something that a person should know about what is served. */
export interface Note {
  /** The same note said again has the same key, also where it counts more by then. */
  key: string;
  level: Status['level'];
  message: string;
}

/** What loading noticed and what the server says now; errors first, each sentence once. */
export function notesOf(scene: Scene | null | undefined, statuses: readonly Status[]): Note[] {
  const notes: Note[] = [];
  const add = (kind: string, level: Status['level'], message: string) => {
    const key = `${scene?.name ?? ''} ${kind}`;
    const before = notes.filter((other) => other.key === key || other.key.startsWith(`${key} #`)).length;
    notes.push({ key: before === 0 ? key : `${key} #${before}`, level, message });
  };
  for (const { id, level, message } of statuses) {
    // An error with other words is another error.
    if (message !== null) add(level === 'error' ? `${id} ${message}` : id, level, message);
  }
  const ofScene = scene?.notes ?? [];
  for (const { id, message } of ofScene) {
    // The server says every note of a scene also as a status; for an instant one of the two may count less.
    const kind = `scene.${id}`;
    const isAlone = ofScene.filter((other) => other.id === id).length === 1;
    if (isAlone && statuses.some((status) => status.id === kind && status.message !== null)) continue;
    add(kind, 'info', message);
  }
  const rank = { error: 0, warning: 1, info: 2 };
  return notes
    .filter(({ message }, index) => notes.findIndex((other) => other.message === message) === index)
    .sort((a, b) => rank[a.level] - rank[b.level]);
}

/** Vertices that lie far from the scene, as loading counted them. */
export function strayCount(scene: Scene | null | undefined): number {
  return scene?.notes.find(({ id }) => id === 'stray_points')?.count ?? 0;
}
