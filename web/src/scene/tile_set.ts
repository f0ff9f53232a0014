import type { DecodedGeometry } from '../decode/messages';
import { childTile, parentTile, type TileFrame, type TileId, tileKey } from '../protocol/frame';

/** What the drawing side keeps for one tile; the tile set owns it and disposes of it. */
export interface Drawable {
  setColours(rgba: Uint8Array<ArrayBuffer>): void;
  setVisible(visible: boolean): void;
  dispose(): void;
}

export type CreateDrawable = (geometry: DecodedGeometry, rgba: Uint8Array<ArrayBuffer>) => Drawable;

interface Shown {
  drawable: Drawable;
  geometry: DecodedGeometry;
  revision: number;
  generation: number;
  /** From an earlier connection: drawn until its successor is complete, never changed. */
  stale: boolean;
}

interface TileEntry {
  id: TileId;
  child_mask: number;
  shown: Shown | null;
  /** Geometry whose colours have not come yet. */
  waitingGeometry: { revision: number; geometry: DecodedGeometry } | null;
  /** Colours whose geometry is not decoded yet. */
  waitingColours: { revision: number; generation: number; rgba: Uint8Array<ArrayBuffer> } | null;
}

export interface TileCounts {
  tiles: number;
  vertices: number;
  triangles: number;
}

/**
 * The tiles this client holds, and which of them are drawn (the REPLACE rule of docs/protocol.md). Decoding ends in any order; what
 * is drawn is always a geometry with colours of its own revision, and colours never go back to an older generation.
 */
export class TileSet {
  #tiles = new Map<string, TileEntry>();
  #selectionDirty = false;

  constructor(private readonly createDrawable: CreateDrawable) {}

  get size(): number {
    return this.#tiles.size;
  }

  /** Every tile that has something to draw, drawn or not. */
  *shownGeometries(): Iterable<{ geometry: DecodedGeometry; visible: boolean }> {
    const selected = this.#selected();
    for (const [key, entry] of this.#tiles) {
      if (entry.shown !== null) yield { geometry: entry.shown.geometry, visible: selected.has(key) };
    }
  }

  /** Tiles whose colours are of this generation, of all that this connection has filled. */
  progress(generation: number): { current: number; total: number } {
    let current = 0;
    let total = 0;
    for (const { shown, waitingGeometry } of this.#tiles.values()) {
      if (shown === null && waitingGeometry === null) continue;
      total += 1;
      if (shown !== null && !shown.stale && shown.generation >= generation) current += 1;
    }
    return { current, total };
  }

  /** The server's frames start anew: what is held stays on the screen, but everything that comes is newer. */
  beginConnection(): void {
    for (const entry of this.#tiles.values()) {
      entry.waitingGeometry = null;
      entry.waitingColours = null;
      if (entry.shown !== null) entry.shown.stale = true;
    }
  }

  /** The new connection has sent all it has: what it did not send again is no longer part of the scene. */
  endStale(): void {
    for (const [key, entry] of this.#tiles) {
      if (entry.shown?.stale) this.#delete(key, entry);
    }
  }

  addGeometry(frame: TileFrame, geometry: DecodedGeometry): void {
    const entry = this.#entry(frame.tile);
    entry.child_mask = frame.child_mask;
    this.#selectionDirty = true;
    const { shown } = entry;
    if (shown !== null && !shown.stale && frame.revision < shown.revision) return;
    entry.waitingGeometry = { revision: frame.revision, geometry };
    this.#join(entry);
  }

  addColours(frame: TileFrame, rgba: Uint8Array<ArrayBuffer>): void {
    const entry = this.#entry(frame.tile);
    entry.child_mask = frame.child_mask;
    const { shown, waitingColours } = entry;
    if (shown !== null && !shown.stale && shown.revision === frame.revision) {
      if (frame.generation < shown.generation) return;
      if (rgba.length !== (shown.geometry.positions.length / 3) * 4) {
        throw new Error(`tile ${tileKey(frame.tile)}: colours of ${rgba.length / 4} vertices for another geometry`);
      }
      shown.generation = frame.generation;
      shown.drawable.setColours(rgba);
      return;
    }
    if (waitingColours !== null && waitingColours.revision === frame.revision && waitingColours.generation > frame.generation)
      return;
    entry.waitingColours = { revision: frame.revision, generation: frame.generation, rgba };
    this.#join(entry);
  }

  remove(id: TileId): void {
    const key = tileKey(id);
    const entry = this.#tiles.get(key);
    if (entry !== undefined) this.#delete(key, entry);
  }

  clear(): void {
    for (const [key, entry] of [...this.#tiles]) this.#delete(key, entry);
  }

  /** Shows and hides tiles by the REPLACE rule; cheap when nothing has changed. Returns true when something may have. */
  updateSelection(): boolean {
    if (!this.#selectionDirty) return false;
    this.#selectionDirty = false;
    const selected = this.#selected();
    for (const [key, entry] of this.#tiles) entry.shown?.drawable.setVisible(selected.has(key));
    return true;
  }

  /** What is on the screen now. */
  counts(): TileCounts {
    const counts: TileCounts = { tiles: 0, vertices: 0, triangles: 0 };
    const selected = this.#selected();
    for (const key of selected) {
      const shown = this.#tiles.get(key)?.shown;
      if (!shown) continue;
      counts.tiles += 1;
      counts.vertices += shown.geometry.positions.length / 3;
      counts.triangles += (shown.geometry.indices?.length ?? 0) / 3;
    }
    return counts;
  }

  #entry(id: TileId): TileEntry {
    const key = tileKey(id);
    let entry = this.#tiles.get(key);
    if (entry === undefined) {
      entry = { id, child_mask: 0, shown: null, waitingGeometry: null, waitingColours: null };
      this.#tiles.set(key, entry);
      this.#selectionDirty = true;
    }
    return entry;
  }

  #join(entry: TileEntry): void {
    const { waitingGeometry, waitingColours } = entry;
    if (waitingGeometry === null || waitingColours === null) return;
    if (waitingGeometry.revision !== waitingColours.revision) return;
    entry.waitingGeometry = null;
    entry.waitingColours = null;
    const { geometry, revision } = waitingGeometry;
    if (waitingColours.rgba.length !== (geometry.positions.length / 3) * 4) {
      throw new Error(
        `tile ${tileKey(entry.id)}: colours of ${waitingColours.rgba.length / 4} vertices for ${geometry.positions.length / 3}`,
      );
    }
    entry.shown?.drawable.dispose();
    const drawable = this.createDrawable(geometry, waitingColours.rgba);
    entry.shown = { drawable, geometry, revision, generation: waitingColours.generation, stale: false };
    this.#selectionDirty = true;
  }

  #delete(key: string, entry: TileEntry): void {
    entry.shown?.drawable.dispose();
    this.#tiles.delete(key);
    this.#selectionDirty = true;
  }

  #selected(): Set<string> {
    const children = new Map<string, string[]>();
    const tops: string[] = [];
    const known = new Set<string>();
    // Tiles of which only descendants are held are walked through as empty ones.
    const link = (id: TileId): void => {
      const key = tileKey(id);
      if (known.has(key)) return;
      known.add(key);
      const parent = parentTile(id);
      if (parent === null) {
        tops.push(key);
        return;
      }
      const parentKey = tileKey(parent);
      const siblings = children.get(parentKey);
      if (siblings === undefined) children.set(parentKey, [key]);
      else siblings.push(key);
      link(parent);
    };
    for (const entry of this.#tiles.values()) link(entry.id);

    const covers = new Map<string, boolean>();
    const covered = (key: string): boolean => {
      const memo = covers.get(key);
      if (memo !== undefined) return memo;
      const entry = this.#tiles.get(key);
      const result = entry !== undefined && (entry.shown !== null || this.#childrenCover(entry, covered));
      covers.set(key, result);
      return result;
    };
    const selected = new Set<string>();
    const visit = (key: string): void => {
      const entry = this.#tiles.get(key);
      if (entry?.shown && !this.#childrenCover(entry, covered)) {
        selected.add(key);
        return;
      }
      for (const child of children.get(key) ?? []) visit(child);
    };
    for (const top of tops) visit(top);
    return selected;
  }

  #childrenCover(entry: TileEntry, covered: (key: string) => boolean): boolean {
    if (entry.child_mask === 0) return false;
    for (let octant = 0; octant < 8; octant += 1) {
      if ((entry.child_mask & (1 << octant)) === 0) continue;
      if (!covered(tileKey(childTile(entry.id, octant)))) return false;
    }
    return true;
  }
}
