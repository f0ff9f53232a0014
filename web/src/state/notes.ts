import type { Scene, Status } from '../protocol/messages';

/** Something that a person should know about what is served. */
export interface Note {
  /** The same note said again has the same key. */
  key: string;
  level: Status['level'];
  message: string;
}

/** What loading noticed and what the server says now; errors first, each sentence once. */
export function notesOf(scene: Scene | null | undefined, statuses: readonly Status[]): Note[] {
  const notes: Note[] = [];
  for (const { id, level, message } of statuses) {
    if (message !== null) notes.push({ key: `status ${id} ${message}`, level, message });
  }
  for (const { id, message } of scene?.notes ?? []) {
    notes.push({ key: `scene ${scene?.name} ${id} ${message}`, level: 'info', message });
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
