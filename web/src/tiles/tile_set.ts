import type { DecodedGeometry, DecodedSigma, DecodedTemperature, DecodedVisible, GeometrySummary } from '../decode/messages';
import type { Vec3 } from '../protocol/messages';
import { parentTile, type TileFrame, type TileId, tileKey } from '../protocol/frame';

/** What the drawing side keeps for one tile; the tile set owns it and disposes of it. */
export interface Drawable {
  setColours(rgba: Uint8Array<ArrayBuffer>): void;
  /** What the sensors saw, from which colours are made here: both layers, or the one that has come anew. */
  setRaw(raw: Partial<RawLayers>): void;
  /** How sure the temperature of each vertex is. */
  setSigma(sigma: DecodedSigma): void;
  setVisible(visible: boolean): void;
  dispose(): void;
}

/** Both raw layers of a tile, a value per vertex. */
export interface RawLayers {
  codes: Uint16Array<ArrayBuffer>;
  scale: number;
  offset: number;
  rgb: Uint8Array<ArrayBuffer>;
}

/** A raw layer cannot be read, or does not fit the tile that it is of. */
export class RawMismatch extends Error {}

export type CreateDrawable = (geometry: DecodedGeometry, rgba: Uint8Array<ArrayBuffer>) => Drawable;

/** How what is drawn may differ from the full mesh. */
export interface DrawnError {
  /** Farthest that its surface may be away. */
  position_m: number;
  /** What channels of visible colours are off because tiles are coarse, for 95 % of the surface, or of the eighth of a tile where it is worst. */
  colour_levels: number;
  /** The same of temperatures; null = there are none. */
  temperature_celsius: number | null;
  /** What rounding adds to the colours as they are drawn: half a step; 0 when they are whole. */
  rounding_levels: number;
  /** The same of temperatures from which colours are made here. */
  rounding_celsius: number;
}

/** The larger ones of two errors; null: of nothing. */
export function worse(a: DrawnError | null, b: DrawnError | null): DrawnError | null {
  if (a === null || b === null) return a ?? b;
  const degrees = Math.max(a.temperature_celsius ?? -1, b.temperature_celsius ?? -1);
  return {
    position_m: Math.max(a.position_m, b.position_m),
    colour_levels: Math.max(a.colour_levels, b.colour_levels),
    temperature_celsius: degrees < 0 ? null : degrees,
    rounding_levels: Math.max(a.rounding_levels, b.rounding_levels),
    rounding_celsius: Math.max(a.rounding_celsius, b.rounding_celsius),
  };
}

interface Shown {
  drawable: Drawable;
  geometry: GeometrySummary;
  revision: number;
  error: DrawnError;
  /** How new the colours are: later connections before earlier ones, then later generations before earlier ones. */
  rank: number;
  /** Rank of what was asked for that they answer: what they may hide, and be hidden by, is decided by it. */
  answer: number;
  /** In which its temperatures came, where the drawing side has both raw layers of this geometry; null: it lacks them. */
  rawStep_celsius: number | null;
  /** Its colours were made here, and no others have come since. */
  isMadeHere: boolean;
  /** Their span and their size allow for no finer one, or hardly. */
  finestStep_celsius: number;
  /** The drawing side has how sure its temperatures are. */
  hasSigma: boolean;
  /**
   * Sequence of the frame that brought its colours over the connection that scene.subscribe was answered on last; 0 where they are as they
   * were claimed then; null: no server knows of them.
   */
  colourSequence: number | null;
  /** The server that is or was connected knows that this geometry is held here. */
  isKnownToServer: boolean;
}

/** Geometry held, as scene.subscribe claims it: level, x, y, z, revision. */
export type TileClaim = [number, number, number, number, number];

/** What of claimed tiles is here beside their geometry, by their places among the claims. */
export interface HeldLayers {
  raw: number[];
  temperature_sigma: number[];
  /** With the sequence of the frame that brought them. */
  colours: [number, number][];
}

/** Claimed tiles, by their places, whose colours need not come again, and the generation that they count as. */
export interface CurrentColours {
  places: readonly number[];
  generation: number;
}

/** A place in the tile tree. It is there while its tile, or one beneath it, is held. */
interface TileNode {
  readonly id: TileId;
  readonly key: string;
  readonly parent: TileNode | null;
  /** Of the newest raw layers, and of the largest colours, that have come of it. */
  readonly received: { temperature: number; visible: number; colours: number };
  /** By octant. */
  readonly children: (TileNode | undefined)[];
  child_mask: number;
  /** That which has come since, with a geometry that cannot be drawn yet. */
  waitingMask: number | null;
  shown: Shown | null;
  /** Geometry whose colours have not come yet. */
  waitingGeometry: { revision: number; geometry: DecodedGeometry; error: DrawnError } | null;
  /** Colours whose geometry is not decoded yet. */
  waitingColours: { revision: number; generation: number; sequence: number; rgba: Uint8Array<ArrayBuffer> } | null;
  /** Raw layers of which not both are there, or whose geometry is not. */
  waitingRaw: { revision: number; temperature: DecodedTemperature | null; visible: DecodedVisible | null } | null;
  /** The same of how sure its temperatures are. */
  waitingSigma: { revision: number; sigma: DecodedSigma } | null;
  /** Rank of the oldest colours that stand on the screen when the children are drawn in this tile's place; NOTHING when they cannot be. */
  coverRank: number;
  /** The same when this place is drawn as well as it can be: by the tile itself or by its children, whichever is newer. */
  bestRank: number;
  /** Number of the selection in which the children took this tile's place. */
  replacedIn: number;
  isDrawn: boolean;
  /** Drawn when all had been sent the last time, and nothing finer has come since. */
  isEnd: boolean;
}

/** Bytes that both raw layers, and a change of colours at most, take of all that is held. */
export interface TileCosts {
  raw_bytes: number;
  change_bytes: number;
}

export interface TileCounts {
  tiles: number;
  vertices: number;
  triangles: number;
}

/** What a claim is of the values that a message may hold: five numbers in a list. */
export const CLAIM_VALUES = 6;

/** Bytes of both raw layers for each vertex, about, before any have come: of scenes of 90,000 to a million vertices they take 1.7 to 2.4. */
const RAW_BYTES_PER_VERTEX = 2.3;
/** Of a change of colours to the dearest method, which may not have been seen yet. */
const CHANGE_BYTES_PER_VERTEX = 2.4;

const NOTHING = Number.NEGATIVE_INFINITY;
/** More than there are generations in one connection. */
const CONNECTION_RANKS = 2 ** 32;
/** Of tiles that are fused here: as new as can be. */
const HERE = Number.MAX_SAFE_INTEGER;
const OCTANTS = [0, 1, 2, 3, 4, 5, 6, 7] as const;

/**
 * The tiles this client holds, and which of them are drawn. Decoding ends in any order; what is drawn is always a geometry with
 * colours of its own revision, and colours never go back to an older generation.
 *
 * The children of a tile are drawn in its place when all of them can be (the REPLACE rule of docs/protocol.md) and nothing that is
 * drawn then has older colours than the tile itself. So no old detail ever stands in front of a newer answer, however coarse; where
 * both are equally new the detail wins. A tile that its children replace may keep old colours: it hides nothing that is newer.
 *
 * While fusing is here (setHere), tiles with raw layers show whatever is set: they are newer than all others, and a tile needs no colours
 * to be drawn.
 *
 * A generation that nobody has asked for, because the scene has changed by itself, is the same answer in another version: detail in the
 * version before stays where it is until its own successor has come.
 */
export class TileSet {
  #nodes = new Map<string, TileNode>();
  #tops = new Set<TileNode>();
  #drawn = new Set<TileNode>();
  #selectionDirty = false;
  #selectionCount = 0;
  #connection = 0;
  /** The geometry of the earlier connection is still good: its colours come alone. */
  #isResumed = false;
  /** Runs of generations, first and last, that answer what the one before the first answers; of this connection, in order. */
  #versions: [number, number][] = [];
  /** Tiles of this level and beyond are not replaced by their children, unless those are newer. */
  #finestLevel = Infinity;
  #isHere = false;

  constructor(private readonly createDrawable: CreateDrawable) {}

  /** Tiles of which anything is held. */
  get size(): number {
    let size = 0;
    for (const node of this.#nodes.values()) if (isHeld(node)) size += 1;
    return size;
  }

  /** Every tile that has something to draw, drawn or not. */
  *shownGeometries(): Iterable<{ level: number; geometry: GeometrySummary; visible: boolean }> {
    for (const { id, shown, isDrawn } of this.#nodes.values()) {
      if (shown !== null) yield { level: id.level, geometry: shown.geometry, visible: isDrawn };
    }
  }

  /**
   * What the server of the last connection knows to be held here, at most `mostTiles`: coarse before fine, what is drawn before what is
   * not. Of so many values of a message there is room for what layersOf() tells of all that is drawn, too.
   */
  claims(mostTiles: number, mostValues = Infinity): TileClaim[] {
    const known = [...this.#nodes.values()].filter(({ shown }) => shown?.isKnownToServer);
    const order = ({ id, isDrawn }: TileNode) => id.level + (isDrawn ? 0 : 256);
    const claims: TileClaim[] = [];
    let left = mostValues;
    for (const { id, shown, isDrawn } of known.sort((a, b) => order(a) - order(b))) {
      if (shown === null) continue;
      left -= CLAIM_VALUES + (isDrawn ? layerValues(shown) : 0);
      if (left < 0 || claims.length === mostTiles) break;
      claims.push([id.level, id.x, id.y, id.z, shown.revision]);
    }
    return claims;
  }

  /**
   * What beside their geometry is here of these claims, of the first ones where it takes more than `mostValues` of a message; temperatures
   * where they are in the step that is asked for.
   */
  layersOf(claims: readonly TileClaim[], mostValues = Infinity, asked_celsius = Infinity): HeldLayers {
    const held: HeldLayers = { raw: [], temperature_sigma: [], colours: [] };
    let left = mostValues;
    for (const [place, [level, x, y, z]] of claims.entries()) {
      const shown = this.#nodes.get(tileKey({ level, x, y, z }))?.shown ?? null;
      if (shown === null) continue;
      left -= layerValues(shown);
      if (left < 0) break;
      if (isInStep(shown, asked_celsius)) held.raw.push(place);
      if (shown.hasSigma) held.temperature_sigma.push(place);
      // Colours that came before those that are made here are not there any more.
      const isMadeHere = shown.isMadeHere || (this.#isHere && shown.rawStep_celsius !== null);
      if (shown.colourSequence !== null && !isMadeHere) held.colours.push([place, shown.colourSequence]);
    }
    return held;
  }

  /** Of how many tiles that are drawn it is not here how sure their temperatures are. */
  lackingSigma(): number {
    let lacking = 0;
    for (const { shown } of this.#drawn) if (shown !== null && !shown.hasSigma) lacking += 1;
    return lacking;
  }

  /**
   * How many tiles are drawn, how many of them can be fused here, the coarsest step in which the temperatures of one came (those that
   * will come finer, as they are asked for, aside), and how many lack colours.
   */
  rawCounts(asked_celsius = Infinity): { drawn: number; raw: number; step_celsius: number; waiting: number } {
    const counts = { drawn: 0, raw: 0, step_celsius: 0, waiting: 0 };
    for (const { waitingGeometry } of this.#nodes.values()) if (waitingGeometry !== null) counts.waiting += 1;
    for (const { shown } of this.#drawn) {
      if (shown === null) continue;
      counts.drawn += 1;
      if (shown.rawStep_celsius === null) continue;
      counts.raw += 1;
      if (isInStep(shown, asked_celsius)) counts.step_celsius = Math.max(counts.step_celsius, shown.rawStep_celsius);
    }
    return counts;
  }

  /** Tiles are fused here, or their colours come from the server again. */
  setHere(isHere: boolean): void {
    if (isHere === this.#isHere) return;
    this.#isHere = isHere;
    const nodes = [...this.#nodes.values()].sort((a, b) => b.id.level - a.id.level);
    for (const node of nodes) {
      this.#joinRaw(node);
      if (isHere && node.shown !== null) node.shown.isMadeHere = node.shown.rawStep_celsius !== null;
      node.bestRank = NaN;
      this.#changed(node);
    }
    this.updateSelection();
  }

  /**
   * The server's frames start anew: what is held stays on the screen, but everything that comes is newer, and geometry comes again
   * unless resume() follows.
   */
  beginConnection(): void {
    this.#connection += 1;
    this.#isResumed = false;
    this.#versions = [];
    for (const node of [...this.#nodes.values()]) {
      node.waitingGeometry = null;
      node.waitingColours = null;
      node.waitingRaw = null;
      node.waitingSigma = null;
      this.#prune(node);
    }
  }

  /**
   * The server has answered the claims: it takes them into account (and sends nothing again that is still good, replaces what is
   * not, removes what is gone), or it does not know them.
   */
  resume(claims: readonly TileClaim[], isGranted: boolean, layers: HeldLayers, current: CurrentColours): void {
    this.#isResumed = isGranted;
    const places = new Map(claims.map(([level, x, y, z], place) => [tileKey({ level, x, y, z }), place]));
    const told = new Set(layers.colours.map(([place]) => place));
    const isCurrent = new Set(current.places);
    for (const node of this.#nodes.values()) {
      const { shown } = node;
      if (shown === null || !this.#isStale(shown)) continue;
      const place = isGranted ? places.get(node.key) : undefined;
      shown.isKnownToServer = place !== undefined;
      shown.colourSequence = place !== undefined && told.has(place) ? 0 : null;
      if (place !== undefined && isCurrent.has(place)) {
        shown.rank = this.#rank(current.generation);
        shown.answer = this.#answer(current.generation);
        this.#changed(node);
      }
      this.#join(node);
    }
  }

  /**
   * The server has sent all that it is asked for: what is drawn now is the picture, and what an earlier connection has left here goes
   * unless the server knows of it.
   */
  settle(): void {
    for (const node of [...this.#nodes.values()]) {
      const { shown } = node;
      if (shown !== null && this.#isStale(shown) && !(this.#isResumed && shown.isKnownToServer)) this.#delete(node);
    }
    const finest = this.#finestLevel;
    this.#finestLevel = Infinity;
    this.#selectionDirty = true;
    this.updateSelection();
    for (const node of this.#nodes.values()) node.isEnd = node.isDrawn;
    this.#finestLevel = finest;
    this.#selectionDirty = finest !== Infinity;
  }

  /** This generation, of which nothing has come yet, is another version of what the one before it answers. */
  isVersion(generation: number): void {
    const last = this.#versions.at(-1);
    if (last !== undefined && last[1] === generation - 1) last[1] = generation;
    else if (last === undefined || last[1] < generation) this.#versions.push([generation, generation]);
  }

  addGeometry(frame: TileFrame, geometry: DecodedGeometry): void {
    const node = this.#node(frame.tile);
    const { shown } = node;
    if (shown !== null && !this.#isStale(shown) && frame.revision < shown.revision) return;
    if (isOlder(frame, node.waitingGeometry)) return;
    const error: DrawnError = {
      // Rounding moves a vertex by half a step along each of three axes at most.
      position_m: frame.geometric_error_m + (frame.position_step_m / 2) * Math.sqrt(3),
      colour_levels: frame.colour_error_levels,
      temperature_celsius: Number.isNaN(frame.temperature_error_celsius) ? null : frame.temperature_error_celsius,
      rounding_levels: 0,
      rounding_celsius: 0,
    };
    node.waitingGeometry = { revision: frame.revision, geometry, error };
    this.#setChildMask(node, frame.child_mask);
    this.#join(node);
  }

  addColours(frame: TileFrame, rgba: Uint8Array<ArrayBuffer>): void {
    const node = this.#node(frame.tile);
    this.#setChildMask(node, frame.child_mask);
    const { waitingColours, received } = node;
    received.colours = Math.max(received.colours, frame.bytes);
    if (isOlder(frame, waitingColours)) return;
    if (waitingColours !== null && waitingColours.revision === frame.revision && waitingColours.generation > frame.generation)
      return;
    node.waitingColours = { revision: frame.revision, generation: frame.generation, sequence: frame.sequence, rgba };
    this.#join(node);
  }

  addRaw(frame: TileFrame, layer: DecodedTemperature | DecodedVisible): void {
    const length = layer.kind === 'visible' ? layer.rgb.length / 3 : layer.codes.length;
    if (length !== frame.vertex_count) {
      throw new RawMismatch(
        `tile ${tileKey(frame.tile)}: a raw layer of ${length} vertices for a geometry of ${frame.vertex_count}`,
      );
    }
    const node = this.#node(frame.tile);
    this.#setChildMask(node, frame.child_mask);
    node.received[layer.kind] = frame.bytes;
    if (isOlder(frame, node.waitingRaw)) return;
    if (node.waitingRaw?.revision !== frame.revision) {
      node.waitingRaw = { revision: frame.revision, temperature: null, visible: null };
    }
    if (layer.kind === 'visible') node.waitingRaw.visible = layer;
    else node.waitingRaw.temperature = layer;
    this.#joinRaw(node);
  }

  addSigma(frame: TileFrame, sigma: DecodedSigma): void {
    const node = this.#node(frame.tile);
    node.waitingSigma = { revision: frame.revision, sigma };
    this.#joinSigma(node);
  }

  /** True when these colours, once added, would put the tile on the screen in the place of older detail that stands there now. */
  wouldHideDetail(frame: TileFrame): boolean {
    const node = this.#nodes.get(tileKey(frame.tile));
    return (
      node !== undefined &&
      node.shown !== null &&
      node.replacedIn === this.#selectionCount &&
      node.coverRank >= this.#answerOf(node.shown) &&
      node.coverRank < this.#answer(frame.generation)
    );
  }

  /** False while the tile is held and is to be drawn itself rather than its children. */
  isReplaced(id: TileId): boolean {
    const node = this.#nodes.get(tileKey(id));
    return node === undefined || node.shown === null || node.coverRank >= this.#answerOf(node.shown);
  }

  remove(id: TileId): void {
    const node = this.#nodes.get(tileKey(id));
    if (node !== undefined) this.#delete(node);
  }

  clear(): void {
    for (const { shown } of this.#nodes.values()) shown?.drawable.dispose();
    this.#nodes.clear();
    this.#tops.clear();
    this.#drawn.clear();
    this.#selectionDirty = true;
  }

  /** Leaves out so many of the finest levels, where a coarser tile is as new as what it stands for; 0: all detail is drawn. */
  leaveOut(levels: number): void {
    let deepest = 0;
    for (const { id, shown } of this.#nodes.values()) if (shown !== null) deepest = Math.max(deepest, id.level);
    const finest = levels === 0 ? Infinity : Math.max(0, deepest - levels);
    if (finest === this.#finestLevel) return;
    this.#finestLevel = finest;
    this.#selectionDirty = true;
  }

  /** Shows and hides tiles by the rule above; cheap when nothing has changed. Returns true when something may have. */
  updateSelection(): boolean {
    if (!this.#selectionDirty) return false;
    this.#selectionDirty = false;
    this.#selectionCount += 1;
    const before = this.#drawn;
    this.#drawn = new Set();
    for (const top of this.#tops) this.#select(top);
    for (const node of before) {
      if (this.#drawn.has(node)) continue;
      node.isDrawn = false;
      node.shown?.drawable.setVisible(false);
    }
    return true;
  }

  /** What is on the screen now. */
  counts(): TileCounts {
    const counts: TileCounts = { tiles: 0, vertices: 0, triangles: 0 };
    for (const { shown } of this.#drawn) {
      if (shown === null) continue;
      counts.tiles += 1;
      counts.vertices += shown.geometry.vertex_count;
      counts.triangles += shown.geometry.triangle_count;
    }
    return counts;
  }

  /** By what has come of these tiles, coarse ones too; of those of which nothing has come yet, by the number of vertices. */
  costs(): TileCosts {
    const sums = { vertices: 0, raw: 0, rawVertices: 0, change: 0 };
    for (const { shown, received } of this.#nodes.values()) {
      if (shown === null) continue;
      const { vertex_count } = shown.geometry;
      const { temperature, visible, colours } = received;
      sums.vertices += vertex_count;
      sums.change += Math.max(colours, vertex_count * CHANGE_BYTES_PER_VERTEX);
      if (temperature === 0 || visible === 0) continue;
      sums.raw += temperature + visible;
      sums.rawVertices += vertex_count;
    }
    const perVertex = sums.rawVertices > 0 ? sums.raw / sums.rawVertices : RAW_BYTES_PER_VERTEX;
    return { raw_bytes: sums.raw + (sums.vertices - sums.rawVertices) * perVertex, change_bytes: sums.change };
  }

  /** The largest errors of what is drawn, of the tiles that `isVisible`; null when there are none. */
  drawnError(isVisible: (centre: Vec3, radius: number) => boolean): DrawnError | null {
    let largest: DrawnError | null = null;
    for (const { shown } of this.#drawn) {
      if (shown === null || !isVisible(shown.geometry.centre, shown.geometry.radius)) continue;
      const step = this.#isHere || shown.isMadeHere ? shown.rawStep_celsius : null;
      const rounding = step === null ? {} : { rounding_levels: 0, rounding_celsius: step / 2 };
      largest = worse(largest, { ...shown.error, ...rounding });
    }
    return largest;
  }

  /** The generations that are drawn, of the tiles that `isVisible`; null: one of an earlier connection. What is fused here has none. */
  drawnGenerations(isVisible: (centre: Vec3, radius: number) => boolean): Set<number | null> {
    const generations = new Set<number | null>();
    for (const { shown } of this.#drawn) {
      if (shown === null || !isVisible(shown.geometry.centre, shown.geometry.radius)) continue;
      if (this.#isHere && shown.rawStep_celsius !== null) continue;
      generations.add(this.#isStale(shown) ? null : shown.answer - this.#rank(0));
    }
    return generations;
  }

  /**
   * How much of the picture shows this generation, in tiles. The picture is what was drawn when all had been sent the last time, and
   * where finer tiles have come since, the finest of them. Others do not count: they may keep older colours.
   */
  progress(generation: number): { current: number; total: number } {
    const wanted = this.#rank(generation);
    const progress = { current: 0, total: 0 };
    const visit = (node: TileNode): void => {
      const isHeldHere = node.shown !== null || node.waitingGeometry !== null;
      if (node.isEnd || (isHeldHere && node.coverRank === NOTHING)) {
        progress.total += 1;
        if (node.shown !== null && node.shown.rank >= wanted) progress.current += 1;
      } else {
        for (const child of node.children) if (child !== undefined) visit(child);
      }
    };
    for (const top of this.#tops) visit(top);
    return progress;
  }

  #rank(generation: number): number {
    return this.#connection * CONNECTION_RANKS + generation;
  }

  /** Rank of the generation that was asked for and of which this one is a version. */
  #answer(generation: number): number {
    for (let i = this.#versions.length - 1; i >= 0; i -= 1) {
      const [first, last] = this.#versions[i]!;
      if (last < generation) break;
      if (first <= generation) return this.#rank(first - 1);
    }
    return this.#rank(generation);
  }

  #answerOf(shown: Shown | null): number {
    if (shown === null) return NOTHING;
    return this.#isHere && shown.rawStep_celsius !== null ? HERE : shown.answer;
  }

  /** Nothing that the tile stands for has newer colours. */
  #isAsNewAsBelow(node: TileNode): boolean {
    const answer = this.#answerOf(node.shown);
    const isOlder = (child: TileNode | undefined): boolean =>
      child !== undefined && (this.#answerOf(child.shown) > answer || child.children.some(isOlder));
    return !node.children.some(isOlder);
  }

  /** From an earlier connection: drawn until its successor is complete, never changed. */
  #isStale(shown: Shown): boolean {
    return shown.rank < this.#rank(0);
  }

  #node(id: TileId): TileNode {
    const key = tileKey(id);
    const known = this.#nodes.get(key);
    if (known !== undefined) return known;
    const above = parentTile(id);
    const parent = above === null ? null : this.#node(above);
    const node: TileNode = {
      id,
      key,
      parent,
      received: { temperature: 0, visible: 0, colours: 0 },
      children: new Array<TileNode | undefined>(8).fill(undefined),
      child_mask: 0,
      waitingMask: null,
      shown: null,
      waitingGeometry: null,
      waitingColours: null,
      waitingRaw: null,
      waitingSigma: null,
      coverRank: NOTHING,
      bestRank: NOTHING,
      replacedIn: 0,
      isDrawn: false,
      isEnd: false,
    };
    this.#nodes.set(key, node);
    if (parent === null) this.#tops.add(node);
    else parent.children[octantOf(id)] = node;
    return node;
  }

  #setChildMask(node: TileNode, child_mask: number): void {
    node.waitingMask = child_mask;
    if (node.child_mask !== child_mask) this.#changed(node);
  }

  /** Brings together what has come of a tile, as far as it fits together. */
  #join(node: TileNode): void {
    this.#joinColours(node);
    this.#joinRaw(node);
    this.#joinSigma(node);
  }

  #joinSigma(node: TileNode): void {
    const { shown, waitingSigma } = node;
    if (waitingSigma === null || shown?.revision !== waitingSigma.revision) return;
    node.waitingSigma = null;
    const { sigma } = waitingSigma;
    if (sigma.codes.length !== shown.geometry.vertex_count) return;
    shown.drawable.setSigma(sigma);
    shown.hasSigma = true;
  }

  #joinRaw(node: TileNode): void {
    const { shown, waitingGeometry, waitingRaw } = node;
    if (waitingRaw === null) return;
    const { revision, temperature, visible } = waitingRaw;
    const isShown = shown?.revision === revision && waitingGeometry?.revision !== revision;
    // In another step temperatures come alone.
    const hasOther =
      isShown && shown.rawStep_celsius !== null && (!this.#isStale(shown) || (this.#isResumed && shown.isKnownToServer));
    if ((temperature === null || visible === null) && !hasOther) return;
    const raw: Partial<RawLayers> = {};
    if (temperature !== null)
      Object.assign(raw, { codes: temperature.codes, scale: temperature.scale, offset: temperature.offset });
    if (visible !== null) raw.rgb = visible.rgb;
    const steps = temperature === null ? {} : stepsOf(temperature);
    if (isShown) {
      node.waitingRaw = null;
      checkRaw(node, raw, shown.geometry);
      shown.drawable.setRaw(raw);
      Object.assign(shown, steps);
      if (this.#isHere) shown.isMadeHere = true;
      this.#changed(node);
    } else if (this.#isHere && waitingGeometry !== null && waitingGeometry.revision === revision) {
      node.waitingRaw = null;
      node.waitingGeometry = null;
      const { geometry, error } = waitingGeometry;
      checkRaw(node, raw, geometry.summary);
      shown?.drawable.dispose();
      // Its colours are made before it is drawn.
      const drawable = this.createDrawable(geometry, new Uint8Array(4 * geometry.summary.vertex_count));
      drawable.setRaw(raw);
      const rank = this.#rank(0);
      node.shown = {
        drawable,
        geometry: geometry.summary,
        revision,
        error,
        rank,
        answer: rank,
        rawStep_celsius: null,
        isMadeHere: true,
        finestStep_celsius: 0,
        ...steps,
        hasSigma: false,
        colourSequence: null,
        isKnownToServer: true,
      };
      if (node.isDrawn) drawable.setVisible(true);
      this.#joinSigma(node);
      this.#arrived(node);
    }
  }

  #joinColours(node: TileNode): void {
    const { shown, waitingGeometry, waitingColours } = node;
    if (waitingColours === null) return;
    const { revision, generation, sequence, rgba } = waitingColours;
    const rank = this.#rank(generation);
    if (shown !== null && shown.revision === revision && (!this.#isStale(shown) || (this.#isResumed && shown.isKnownToServer))) {
      node.waitingColours = null;
      if (rank < shown.rank) return;
      checkLength(node, rgba, shown.geometry);
      shown.rank = rank;
      shown.answer = this.#answer(generation);
      shown.colourSequence = sequence;
      shown.isMadeHere = false;
      shown.error.rounding_levels = roundingOf(rgba);
      shown.drawable.setColours(rgba);
      this.#arrived(node);
    } else if (waitingGeometry !== null && waitingGeometry.revision === revision) {
      node.waitingGeometry = null;
      node.waitingColours = null;
      const { geometry, error } = waitingGeometry;
      checkLength(node, rgba, geometry.summary);
      shown?.drawable.dispose();
      const drawable = this.createDrawable(geometry, rgba);
      error.rounding_levels = roundingOf(rgba);
      const answer = this.#answer(generation);
      node.shown = {
        drawable,
        geometry: geometry.summary,
        revision,
        error,
        rank,
        answer,
        rawStep_celsius: null,
        isMadeHere: false,
        finestStep_celsius: 0,
        hasSigma: false,
        colourSequence: sequence,
        isKnownToServer: true,
      };
      if (node.isDrawn) drawable.setVisible(true);
      this.#arrived(node);
    }
  }

  #arrived(node: TileNode): void {
    for (let at = node.parent; at !== null; at = at.parent) at.isEnd = false;
    this.#changed(node);
  }

  #delete(node: TileNode): void {
    node.shown?.drawable.dispose();
    node.shown = null;
    node.waitingGeometry = null;
    node.waitingColours = null;
    node.waitingRaw = null;
    node.waitingSigma = null;
    node.child_mask = 0;
    node.waitingMask = null;
    node.isDrawn = false;
    node.isEnd = false;
    this.#drawn.delete(node);
    this.#changed(node);
    this.#prune(node);
  }

  /** Takes away a node of which nothing is held, and the empty ones above it. */
  #prune(node: TileNode): void {
    for (let at: TileNode | null = node; at !== null; at = at.parent) {
      if (isHeld(at) || at.children.some((child) => child !== undefined)) return;
      this.#nodes.delete(at.key);
      if (at.parent === null) this.#tops.delete(at);
      else at.parent.children[octantOf(at.id)] = undefined;
    }
  }

  /** Brings the ranks of a tile that has changed, and of those above it, up to date. */
  #changed(node: TileNode): void {
    this.#selectionDirty = true;
    for (let at: TileNode | null = node; at !== null; at = at.parent) {
      at.coverRank = coverRankOf(at);
      // Children in the mask of before are drawn until the tile can be that which names others.
      if (at.waitingMask !== null && (at.waitingGeometry === null || at.coverRank === NOTHING)) {
        at.child_mask = at.waitingMask;
        at.waitingMask = null;
        at.coverRank = coverRankOf(at);
      }
      const bestRank = Math.max(at.coverRank, this.#answerOf(at.shown));
      if (bestRank === at.bestRank) return;
      at.bestRank = bestRank;
    }
  }

  #select(node: TileNode): void {
    const isFineEnough = node.id.level >= this.#finestLevel && this.#isAsNewAsBelow(node);
    if (node.shown !== null && (node.coverRank < this.#answerOf(node.shown) || isFineEnough)) {
      this.#drawn.add(node);
      if (node.isDrawn) return;
      node.isDrawn = true;
      node.shown.drawable.setVisible(true);
      return;
    }
    node.replacedIn = this.#selectionCount;
    // Of tiles that are not held themselves, and not all of whose children are, whatever is there is drawn.
    for (const child of node.children) if (child !== undefined) this.#select(child);
  }
}

/** What HeldLayers of a tile are of the values that a message may hold. */
function layerValues({ rawStep_celsius, hasSigma, colourSequence }: Shown): number {
  return (rawStep_celsius === null ? 0 : 1) + (hasSigma ? 1 : 0) + (colourSequence === null ? 0 : 3);
}

/** Half of the step to which colours have been rounded: multiples of a power of two, with 255 in the place of 256. */
function roundingOf(rgba: Uint8Array): number {
  let bits = 16;
  for (let i = 0; i < rgba.length; i += 1) {
    if ((i & 3) === 3) continue;
    const channel = rgba[i]!;
    if (channel !== 255) bits |= channel;
    if ((bits & 1) !== 0) return 0;
  }
  return (bits & -bits) / 2;
}

function checkLength(node: TileNode, rgba: Uint8Array, { vertex_count }: GeometrySummary): void {
  if (rgba.length === vertex_count * 4) return;
  throw new Error(`tile ${node.key}: colours of ${rgba.length / 4} vertices for a geometry of ${vertex_count}`);
}

function checkRaw(node: TileNode, { codes, rgb }: Partial<RawLayers>, { vertex_count }: GeometrySummary): void {
  const lengths = [codes?.length ?? vertex_count, (rgb?.length ?? 3 * vertex_count) / 3];
  if (lengths.every((length) => length === vertex_count)) return;
  throw new RawMismatch(
    `tile ${node.key}: temperatures and colours of ${lengths.join(' and ')} vertices for a geometry of ${vertex_count}`,
  );
}

/** Temperatures are here, and come no finer where steps of `asked_celsius` are asked for. */
function isInStep({ rawStep_celsius, finestStep_celsius }: Shown, asked_celsius: number): boolean {
  return rawStep_celsius !== null && rawStep_celsius <= Math.max(asked_celsius * 1.0001, finestStep_celsius);
}

/** The largest codes stand for no number. */
const CODES = 65533;

function stepsOf({ codes, scale, offset }: DecodedTemperature): Pick<Shown, 'rawStep_celsius' | 'finestStep_celsius'> {
  let lowest = CODES;
  let highest = 0;
  for (const code of codes) {
    if (code >= CODES) continue;
    if (code < lowest) lowest = code;
    if (code > highest) highest = code;
  }
  if (lowest > highest) return { rawStep_celsius: 0, finestStep_celsius: 0 };
  const farthest = Math.max(Math.abs(lowest * scale + offset), Math.abs(highest * scale + offset));
  // A span has room for so many steps, and a 32-bit float for such ones.
  return { rawStep_celsius: scale, finestStep_celsius: Math.max(((highest - lowest + 1) * scale) / 65000, farthest * 2 ** -22) };
}

/** Decoded after what has come of a newer revision, with which it has nothing to do. */
function isOlder({ revision }: TileFrame, waiting: { revision: number } | null): boolean {
  return waiting !== null && revision < waiting.revision;
}

function octantOf(id: TileId): number {
  return (id.x & 1) + (id.y & 1) * 2 + (id.z & 1) * 4;
}

function isHeld(node: TileNode): boolean {
  return node.shown !== null || node.waitingGeometry !== null || node.waitingColours !== null;
}

function coverRankOf(node: TileNode): number {
  if (node.child_mask === 0) return NOTHING;
  let oldest = Number.POSITIVE_INFINITY;
  for (const octant of OCTANTS) {
    if ((node.child_mask & (1 << octant)) !== 0) oldest = Math.min(oldest, node.children[octant]?.bestRank ?? NOTHING);
  }
  return oldest;
}
