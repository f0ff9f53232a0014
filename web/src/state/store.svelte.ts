import type {
  CameraPose,
  Extremes,
  Fusion,
  FusionChange,
  Hello,
  Histogram,
  Method,
  Palette,
  Probe,
  Quality,
  Scene,
  Status,
  StreamComplete,
  StreamStats,
  Vec3,
} from '../protocol/messages';
import type { UpAxis } from '../view/first_view';
import type { DrawnError, TileCosts, TileCounts } from '../tiles/tile_set';
import type { CatalogueFailure } from '../transport/catalogue_loader';
import type { PartFailure } from '../transport/part_loader';
import { type LinkState, QUIET_MS } from '../transport/connection';
import { type HighlightContrast, needsOutline } from '../view/highlight_contrast';
import type { Mark } from '../view/markers';
import { decimalsOf } from './decimals';
import { highlightKey, withChange } from './fusion_change';
import { MapAge } from './map_age';
import { type Note, notesOf } from './notes';
import type { Robot } from './robot';

/** A reading of the scene at a place. */
export interface Reading {
  /** Canvas place that was asked about, CSS pixels. */
  x: number;
  y: number;
  probe: Probe;
}

/** Ids of the two methods that show one modality alone; every other method is a fused view. */
export const THERMAL_VIEW = 'thermal_only';
export const VISIBLE_VIEW = 'visible_only';
export type ViewMode = 'thermal' | 'visible' | 'fused';

export function viewModeOf(method: string): ViewMode {
  if (method === THERMAL_VIEW) return 'thermal';
  return method === VISIBLE_VIEW ? 'visible' : 'fused';
}

/** Whether a line is drawn around what is highlighted; automatic: where colours alone do not show it to everybody. */
export type OutlineWish = 'automatic' | 'on' | 'off';

/** Where colours are made; coming: raw layers are on their way here. */
export type FusingPlace = 'robot' | 'coming' | 'here';

/** A picture that takes longer to show another method is said to be behind it. */
const PENDING_AFTER_MS = 500;

export const DEFAULT_BACKGROUND = '#1c1d1f';

/** Everything the interface shows. Written by the session alone; the interface reads it and calls the session's actions. */
export class Store {
  link = $state.raw<LinkState>({ phase: 'connecting', attempt: 1 });
  /** When the connection was lost, on performance.now()'s clock; null while it is up or before the first one. */
  lostAt = $state<number | null>(null);
  /** When the server was heard last, on the same clock, as of the last tick; null while there is no connection. */
  heardAt = $state<number | null>(null);
  server = $state.raw<Pick<Hello, 'server' | 'role' | 'limits' | 'capabilities'> | null>(null);
  /** Undefined before the first hello, null when the server has no scene. */
  scene = $state.raw<Scene | null | undefined>(undefined);
  methods = $state.raw<Method[]>([]);
  palettes = $state.raw<Palette[]>([]);
  /** Why there are no methods and palettes, or only those of before. */
  catalogueFailure = $state.raw<CatalogueFailure | null>(null);
  /** Why the controls around the picture are not there. */
  partFailure = $state.raw<PartFailure | null>(null);
  /** What the first picture takes has come over the link, or there is none: now anything else may be asked for. */
  isLinkFree = $state(false);
  /** As the server last said it. */
  fusionInForce = $state.raw<Fusion | null>(null);
  generation = $state(0);
  /** How vertices without temperature are shown follows the view, until the user says it. */
  missingIsAutomatic = $state(true);
  /** What the user has asked for and the server has not answered yet. */
  wanted = $state.raw<FusionChange | null>(null);
  quality = $state.raw<Quality | null>(null);
  /** Why a field was refused; the key is the field's path, such as `params.alpha`. */
  refusals = $state<Record<string, string>>({});

  histogram = $state.raw<Histogram | null>(null);
  /** Of which settings the histogram says how much is highlighted: their highlightKey; null: of none that are known. */
  shareOf = $state<string | null>(null);
  /** Methods that are known to highlight. */
  readonly highlighting: Record<string, true> = {};
  extremes = $state.raw<Extremes | null>(null);
  /** The hottest and the coldest place of the scene, and of what is on the screen, as they stand on it. */
  marks = $state.raw<readonly Mark[]>([]);
  marksShown = $state(true);
  /** The robot that maps the scene; null: none is known. */
  robot = $state.raw<Robot | null>(null);
  robotShown = $state(true);
  /** The camera goes along with it. */
  followsRobot = $state(false);
  /** What is less sure than that is hatched, kelvin; null: nothing. */
  hatchAbove_kelvin = $state<number | null>(null);
  outlineWish = $state<OutlineWish>('automatic');
  /** Of the newest colours of the whole scene; null where they say of nothing that it is highlighted. */
  highlightContrast = $state.raw<HighlightContrast | null>(null);
  /** Under the pointer. */
  hover = $state.raw<Reading | null>(null);
  /** Readings pinned by a click, newest last. */
  pinned = $state.raw<{ reading: Reading; place: { x: number; y: number } | null } | null>(null);
  probing = $state(false);

  fusingWish = $state<'automatic' | 'here' | 'robot'>('automatic');
  fusingPlace = $state<FusingPlace>('robot');
  /** Share of the drawn tiles whose raw layers are here. */
  rawShare = $state(0);
  /** The library that makes colours here is ready. */
  hasFusingLibrary = $state(false);
  /** What the robot has counted last for a setting of colours that are made here, beside what it says of every scene. */
  fusingCount = $state.raw<{ method: string; bytes: number } | null>(null);
  /** What raw layers, or a change of colours, of all that is here take. */
  costs = $state.raw<TileCosts>({ raw_bytes: 0, change_bytes: 0 });
  /** Why colours are not made here though they are wanted to be. */
  fusingProblem = $state<string | null>(null);

  stats = $state.raw<StreamStats | null>(null);
  statuses = $state.raw<Status[]>([]);
  complete = $state.raw<StreamComplete | null>(null);
  shown = $state.raw<TileCounts>({ tiles: 0, vertices: 0, triangles: 0 });
  /** The first picture is on the screen: what is not needed for it need not wait any longer. */
  pictureStands = $state(false);
  received_bytes = $state(0);
  rate_bytes_per_s = $state(0);
  round_trip_ms = $state<number | null>(null);
  /** Since when the picture has been behind the settings; null when it is not. */
  behindSince = $state<number | null>(null);
  /** Since when settings that are shown by what is here have not been in the picture; null when they are. */
  hereSince = $state<number | null>(null);
  /** Since when colours that are made here have waited for facts of the scene; null: they do not. */
  factsSince = $state<number | null>(null);
  /** Share of the tiles that show the newest settings. */
  progress = $state(1);
  /** Of the scene that the tiles of the picture are known to be of; -1: of none. */
  pictureRevision = $state(-1);
  /** Method that all of the picture showed when it was last complete; null before the first time. */
  pictureMethod = $state<string | null>(null);
  /** Methods that parts of the picture show now. */
  shownMethods = $state.raw<readonly string[]>([]);
  /** Nothing that is drawn has the settings that the server has answered last. */
  isOfOldSettings = $state(false);
  /** What the last finished change cost: bytes received and time until all of it was on the screen. */
  lastUpdate = $state.raw<{ bytes: number; ms: number } | null>(null);
  /** How what is on the screen may differ from the full mesh; null = there is nothing. */
  drawnError = $state.raw<DrawnError | null>(null);
  camera = $state.raw<CameraPose | null>(null);
  axes = $state.raw<{ x: Vec3; y: Vec3; z: Vec3 }>({ x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] });
  upAxis = $state<UpAxis>('y');
  /** Diameter of a cloud's points, metres; null: as far as they are apart. */
  pointDiameter_m = $state<number | null>(null);
  /** When the browser took the GPU away, on performance.now()'s clock; null while the picture is drawn. */
  graphicsLostAt = $state<number | null>(null);
  background = $state(DEFAULT_BACKGROUND);
  failure = $state<string | null>(null);

  /** performance.now(), as old as the last tick; ages are counted with it. */
  now = $state(performance.now());
  panelsHidden = $state(false);
  panelOpen = $state(true);
  helpOpen = $state(false);
  /** The baseline is being marked. */
  isMarkingBaseline = $state(false);
  /** Why it could not be marked the last time. */
  baselineRefusal = $state<string | null>(null);
  /** All notes are shown, closed ones too. */
  notesOpen = $state(false);
  /** Keys of the notes that the user has closed. */
  closedNotes = $state.raw<readonly string[]>([]);

  /** The settings as the controls show them: in force, with what is on its way laid over. */
  readonly fusion = $derived(this.fusionInForce === null ? null : withChange(this.fusionInForce, this.wanted, this.methods));
  /** The range as it is named: one that follows the scene once it is in force, as nobody here knows its ends before. */
  readonly range = $derived(
    (this.wanted?.range !== undefined && this.wanted.range.mode !== 'manual' ? this.fusionInForce : this.fusion)?.range ?? null,
  );
  /** How much is highlighted is known of exactly what the controls show. */
  readonly isShareKnown = $derived(this.fusion !== null && this.shareOf === highlightKey(this.fusion));
  readonly method = $derived(this.methods.find((method) => method.id === this.fusion?.method) ?? null);
  readonly palette = $derived(this.palettes.find((palette) => palette.id === this.fusion?.palette) ?? null);
  /** There are temperatures that are numbers: an axis has something to stand on. */
  readonly hasScale = $derived(this.scene?.temperature.min != null);
  /** There are temperatures: those beyond the sensor's range are no numbers, and not missing either. */
  readonly hasThermal = $derived(
    this.hasScale || (this.scene?.temperature.over_range_count ?? 0) + (this.scene?.temperature.under_range_count ?? 0) > 0,
  );
  /** With how many decimals temperatures are written: the scene's, or those of the range that is looked at, are told apart. */
  readonly decimals = $derived(decimalsOf(this.scene?.temperature, this.fusion?.range));
  /** Somebody has said that the scene is in metres; otherwise its lengths are shown in units. */
  readonly isMetric = $derived(this.scene?.metric === true);
  /** Without thermal data every method shows the visible colours. */
  readonly isOutlined = $derived(
    this.outlineWish === 'on' ||
      (this.outlineWish === 'automatic' && this.highlightContrast !== null && needsOutline(this.highlightContrast)),
  );
  readonly viewMode = $derived<ViewMode>(this.hasThermal ? viewModeOf(this.fusion?.method ?? '') : 'visible');
  /** What the palette chooser says beside the palette is no note. */
  readonly notes = $derived<Note[]>(
    notesOf(
      this.scene,
      this.statuses.filter(({ id }) => !/palette|fusion_safe/.test(id)),
    ),
  );
  readonly #mapAge = new MapAge();
  readonly #now_s = $derived((performance.timeOrigin + this.now) / 1000);
  /** How long ago the newest part of a live map was seen, seconds; null where nobody has said when. */
  readonly mapAge_s = $derived.by(() => {
    const newest = this.scene?.live === true ? (this.scene.observed?.newest ?? null) : null;
    const now_s = this.#now_s;
    this.#mapAge.newestIs(newest, now_s);
    return this.#mapAge.at(now_s);
  });
  /** What time it is, Unix seconds, as whoever sees the map has it. */
  readonly mapNow_s = $derived(this.mapAge_s === null ? this.#now_s : this.#mapAge.clock(this.#now_s));
  /** The palette stands for changes of temperature, not for the range. */
  readonly changeScale = $derived(this.fusion?.change_scale ?? null);
  /** The scene has a baseline, and when it was marked (Unix seconds; null: never); undefined: it has none. */
  readonly baseline = $derived(this.scene?.baseline);
  readonly connected = $derived(this.link.phase === 'open');
  /** Since when the picture has been behind what is named, whoever makes its colours; null when it is not. */
  readonly lateSince = $derived.by(() => {
    const since = [this.behindSince, this.hereSince, this.factsSince].filter((one) => one !== null);
    return since.length === 0 ? null : Math.min(...since);
  });
  readonly behind = $derived(this.lateSince !== null && this.now - this.lateSince > 150);
  /** All that was asked for has come, and is drawn or will be in a moment. */
  readonly settled = $derived(this.complete !== null && this.behindSince === null && !this.behind);
  /** Something of the picture may have gone from the scene, or be still to come. */
  readonly isOfOldScene = $derived(this.pictureRevision < (this.scene?.revision ?? -1));
  /** What is on its way for longer than a moment, or waits for a connection. */
  readonly unconfirmed = $derived<FusionChange | null>(
    this.wanted !== null && (!this.connected || (this.behindSince !== null && this.now - this.behindSince > PENDING_AFTER_MS))
      ? this.wanted
      : null,
  );
  /** What parts of the picture show instead of the method that is named. */
  readonly otherMethods = $derived(this.shownMethods.filter((method) => method !== this.fusion?.method));
  /** The picture does not show the method that is named, or not everywhere, and that for longer than a moment. */
  readonly methodIsPending = $derived(
    this.otherMethods.length > 0 &&
      ((!this.connected && this.hereSince === null) || (this.lateSince !== null && this.now - this.lateSince > PENDING_AFTER_MS)),
  );
  /** The picture shows the method that is named, but for longer than a moment nothing of what else has been set: its colours are not the palette's, say. */
  readonly settingsArePending = $derived(
    this.connected &&
      !this.methodIsPending &&
      (this.isOfOldSettings || this.wanted !== null) &&
      this.behindSince !== null &&
      this.now - this.behindSince > PENDING_AFTER_MS,
  );
  /** For how long nothing has been heard of a server that says something every second; null where that is no longer than usual, as without a scene. */
  readonly silentFor_s = $derived(
    this.connected && this.scene !== null && this.heardAt !== null && this.now - this.heardAt > QUIET_MS
      ? (this.now - this.heardAt) / 1000
      : null,
  );
  /** How exact the picture is; nobody can say that of a picture of a link that is lost or silent, or of a scene that is another one by now. */
  readonly accuracy = $derived(
    this.connected && this.silentFor_s === null && this.graphicsLostAt === null && !(this.isOfOldScene && this.behind)
      ? this.drawnError
      : null,
  );
  readonly graphicsLostFor_s = $derived(this.graphicsLostAt === null ? 0 : Math.max(0, (this.now - this.graphicsLostAt) / 1000));
  readonly lostFor_s = $derived(this.lostAt === null ? 0 : Math.max(0, (this.now - this.lostAt) / 1000));
}
