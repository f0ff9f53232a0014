import {
  type AgeChange,
  type Fusion,
  type FusionChange,
  fusionState,
  type ParameterValue,
  type RangeChange,
} from '../protocol/messages';
import { Coalescer } from '../transport/coalescer';
import { BUSY, ConnectionLost, RpcError } from '../transport/connection';
import { FusionRefusal } from '../fusion/fusion_refusal';
import { mergedChange, rangeChange, wholeChange } from './fusion_change';
import { unmeasuredColour } from './unmeasured';
import { type Store, THERMAL_VIEW, type ViewMode, viewModeOf, VISIBLE_VIEW } from './store.svelte';

/** Least time between two changes of the settings. */
const CHANGE_INTERVAL_MS = 33;
const BUSY_WAIT_MS = 300;
/** Changes that are shown already: the server is told so that other things keep up, once they rest or after a while. */
const TELL_REST_MS = 1000;
const TELL_INTERVAL_MS = 5000;
/** All but the outermost temperatures, where the server has named no others. */
const FIRST_PERCENTILES: RangeChange = { mode: 'percentile', low: 0.5, high: 99.5 };

/** What the settings need of the session they belong to. */
export interface SettingsSession {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  /** The user has asked for other settings: the picture is behind until they are shown. */
  onChange: () => void;
  /** Other settings are in force. */
  onInForce: () => void;
  /** Anything but a refusal. */
  onProblem: (error: unknown) => void;
  /** Shows settings by what is here; null when the robot has to. Throws FusionRefusal. */
  fuseHere: (wanted: Fusion) => Fusion | null;
}

/**
 * The settings of the fusion: what is in force, what the user has asked for and what the server refused, in the store. The newest
 * generation counts, in whatever order answers and notifications come.
 */
export class Settings {
  readonly #sender: Coalescer<FusionChange>;
  /** Of what is fused here. */
  readonly #teller: Coalescer<FusionChange>;
  #rememberedParams = new Map<string, Record<string, ParameterValue>>();
  #lastFusedMethod: string | null = null;
  /** How the range followed the scene before it was held, and which percentiles it last had. */
  #following: RangeChange = FIRST_PERCENTILES;
  #percentiles: RangeChange = FIRST_PERCENTILES;
  /** What the user has said of vertices without temperature; null: nothing. */
  #chosenMissing: string | null = null;
  /** The user has chosen settings; those of a first view are the server's, which knows the scene. */
  #hasChosen = false;
  /** By generation, of this connection. */
  readonly #methodOf = new Map<number, string>();
  /** Generation of the settings that the server has answered last: later ones are of a scene that has changed by itself. */
  #answered = 0;
  /** How many settings have been shown here. */
  #countHere = 0;
  /** A change went under with its connection: it is still wanted, and is sent with the rest when there is another one. */
  #hasUnanswered = false;

  constructor(
    private readonly store: Store,
    private readonly session: SettingsSession,
  ) {
    this.#sender = new Coalescer({
      send: (change) => this.send(change),
      merge: mergedChange,
      interval_ms: CHANGE_INTERVAL_MS,
      max_in_flight: 3,
      onIdle: () => {
        if (!this.#hasUnanswered) store.wanted = null;
      },
    });
    this.#teller = new Coalescer({
      send: (change) => this.#tell(change),
      merge: mergedChange,
      interval_ms: TELL_INTERVAL_MS,
      rest_ms: TELL_REST_MS,
      max_in_flight: 1,
    });
  }

  /** True while a change waits or is unanswered. */
  get busy(): boolean {
    return this.#sender.busy || this.#teller.busy;
  }

  get answeredGeneration(): number {
    return this.#answered;
  }

  /** The method of a generation of this connection: generations of which nothing was said have that of the one before. */
  methodOf(generation: number): string | undefined {
    let newest = -1;
    for (const known of this.#methodOf.keys()) if (known <= generation && known > newest) newest = known;
    return this.#methodOf.get(newest);
  }

  // Actions of the interface

  setMethod(method: string): void {
    const current = this.store.fusion;
    if (current === null || current.method === method) return;
    this.#rememberedParams.set(current.method, current.params);
    const params = { ...this.#rememberedParams.get(method), ...this.#sharedTemperatures(current, method) };
    const own = Object.keys(params).length === 0 ? {} : { params };
    this.#change({ method, ...own, ...this.#missingFor(method, current.palette) }, true);
  }

  setViewMode(mode: ViewMode): void {
    if (mode === 'thermal') this.setMethod(THERMAL_VIEW);
    else if (mode === 'visible') this.setMethod(VISIBLE_VIEW);
    else if (this.store.viewMode !== 'fused') {
      const first = this.store.methods.find((method) => viewModeOf(method.id) === 'fused');
      const method = this.#lastFusedMethod ?? first?.id;
      if (method !== undefined) this.setMethod(method);
    }
  }

  /** `settled` false while a slider is being dragged. */
  setParameter(name: string, value: ParameterValue, settled: boolean): void {
    this.#change({ params: { [name]: value } }, settled);
  }

  setPalette(palette: string): void {
    const method = this.store.fusion?.method ?? '';
    this.#change({ palette, ...this.#missingFor(method, palette) }, true);
  }

  /** A colour, "visible", or "automatic": a colour in the view of temperatures alone, where a visible colour would be read as one of them. */
  setMissing(missing: string, settled: boolean): void {
    this.store.missingIsAutomatic = missing === 'automatic';
    this.#chosenMissing = this.store.missingIsAutomatic ? null : missing;
    if (!this.store.missingIsAutomatic) this.#change({ missing }, settled);
    else if (this.store.fusion !== null) {
      const change = this.#missingFor(this.store.fusion.method, this.store.fusion.palette);
      if (change.missing !== undefined) this.#change(change, settled);
    }
  }

  /** How what was seen long ago is shown; `settled` false while a slider is being dragged. */
  setAge(age: AgeChange, settled: boolean): void {
    this.#change({ age }, settled);
  }

  setRange(min: number, max: number, settled: boolean): void {
    this.#change({ range: { mode: 'manual', min: Math.min(min, max), max: Math.max(min, max) } }, settled);
  }

  /** Holds the range where it is, or lets it follow the scene again as it did before. */
  toggleRangeLock(): void {
    const range = this.store.fusion?.range;
    if (range === undefined || range.min === null || range.max === null) return;
    if (range.mode === 'manual') {
      this.#change({ range: this.#following }, true);
      return;
    }
    this.#following = rangeChange(range);
    this.setRange(range.min, range.max, true);
  }

  /** To the extremes of the scene, or from there back to all but the outermost temperatures. */
  toggleRangeExtremes(): void {
    const range = this.store.fusion?.range;
    if (range === undefined || range.min === null) return;
    if (range.mode === 'percentile') this.#percentiles = rangeChange(range);
    this.#following = range.mode === 'auto' ? this.#percentiles : { mode: 'auto' };
    this.#change({ range: this.#following }, true);
  }

  // The connection

  /**
   * A new connection with its own settings. Returns the user's, when `isReturning` and there are any: they are to be sent before
   * anything is drawn, and are shown as wanted until then.
   */
  greeted(fusion: Fusion, isReturning: boolean): FusionChange | null {
    const { store } = this;
    const chosen = isReturning && this.#hasChosen ? (store.fusion ?? store.fusionInForce) : null;
    const before = chosen === null ? null : wholeChange(chosen);
    this.#sender.reset();
    this.#teller.reset();
    this.#hasUnanswered = false;
    store.fusionInForce = fusion;
    store.wanted = before;
    store.refusals = {};
    store.generation = 0;
    this.#answered = 0;
    this.#methodOf.clear();
    this.#methodOf.set(0, fusion.method);
    this.#rememberFused(fusion);
    return before;
  }

  /** Methods and palettes are there, or another scene: what is to be said of vertices without temperature depends on them. */
  reconsiderMissing(): void {
    const { fusion, scene } = this.store;
    if (!this.#hasChosen || fusion === null || scene == null) return;
    const change = this.#missingFor(fusion.method, fusion.palette);
    if (change.missing !== undefined) this.#change(change, true);
  }

  /** Sends a change at once and takes in the answer; never rejects. */
  async send(change: FusionChange): Promise<void> {
    const { store } = this;
    const count = this.#countHere;
    try {
      const { generation, fusion } = fusionState(await this.session.request('fusion.set', change), 'fusion.set');
      this.#answered = Math.max(this.#answered, generation);
      // What is shown here since is what is set.
      if (count === this.#countHere) this.inForce(generation, fusion);
      else this.#isTold(generation, fusion);
    } catch (error) {
      if (error instanceof RpcError && error.code === BUSY) {
        // Too fast for the server, not wrong: the newest wish is still to be told.
        await new Promise((resolve) => setTimeout(resolve, BUSY_WAIT_MS));
        if (store.connected && count === this.#countHere) this.#sender.push(store.wanted ?? change);
        else if (store.connected) this.#tellAll();
      } else if (error instanceof RpcError) this.refused(error, change);
      else if (error instanceof ConnectionLost) this.#hasUnanswered = true;
      else this.session.onProblem(error);
    }
  }

  /** The server says what is in force; an older generation than the one known is news of yesterday. */
  inForce(generation: number, fusion: Fusion): void {
    const { store } = this;
    this.#methodOf.set(generation, fusion.method);
    if (generation < store.generation) return;
    const isNew = generation !== store.generation;
    store.generation = generation;
    store.fusionInForce = fusion;
    this.#rememberFused(fusion);
    if (isNew) this.session.onInForce();
  }

  /** Shows a refusal at the field it is about, or at the one that was changed. */
  refused(error: RpcError, change: FusionChange = {}): void {
    this.store.refusals = { ...this.store.refusals, [refusedField(error.field ?? '', change)]: error.message };
  }

  #change(change: FusionChange, isSettled: boolean): void {
    const { store } = this;
    this.#hasChosen = true;
    store.wanted = store.wanted === null ? change : mergedChange(store.wanted, change);
    store.refusals = {};
    if (this.#isShownHere(change) || !store.connected) return;
    // The server hears of what was shown before in its turn.
    const untold = this.#teller.take();
    if (untold !== undefined) void this.#tell(untold);
    this.session.onChange();
    this.#sender.push(change);
    if (isSettled) this.#sender.flush();
  }

  /** Fused here, or refused here: nothing is left to ask the server for. */
  #isShownHere(change: FusionChange): boolean {
    const { store } = this;
    if (store.fusion === null) return false;
    try {
      const inForce = this.session.fuseHere(store.fusion);
      if (inForce === null) return false;
      store.fusionInForce = inForce;
      this.#rememberFused(inForce);
    } catch (error) {
      if (!(error instanceof FusionRefusal)) throw error;
      store.wanted = null;
      const field = error.field in (store.fusion?.params ?? {}) ? `params.${error.field}` : error.field;
      store.refusals = { [refusedField(field, change)]: error.message };
      return true;
    }
    store.wanted = null;
    this.#countHere += 1;
    const unsent = this.#sender.take();
    if (store.connected) this.#teller.push(unsent === undefined ? change : mergedChange(unsent, change));
    return true;
  }

  /** Whatever the server knows of it. */
  #tellAll(): void {
    const { fusion } = this.store;
    if (fusion !== null) this.#teller.push(wholeChange(fusion));
  }

  #isTold(generation: number, fusion: Fusion): void {
    this.#methodOf.set(generation, fusion.method);
    this.store.generation = Math.max(this.store.generation, generation);
  }

  /** The server keeps up with what is shown here; what it answers is known already. */
  async #tell(change: FusionChange): Promise<void> {
    try {
      const { generation, fusion } = fusionState(await this.session.request('fusion.set', change), 'fusion.set');
      this.#answered = Math.max(this.#answered, generation);
      this.#isTold(generation, fusion);
    } catch (error) {
      // It may have heard of others meanwhile.
      if (error instanceof RpcError && error.code === BUSY) this.#tellAll();
      else if (error instanceof RpcError) this.refused(error, change);
      else this.session.onProblem(error);
    }
  }

  /** What is to be said of vertices without temperature beside another method or palette; where none has one, all show the visible colours. */
  #missingFor(method: string, palette_id: string): Pick<FusionChange, 'missing'> {
    const missing = this.#missingWanted(method, palette_id);
    return missing === null || missing === this.store.fusion?.missing ? {} : { missing };
  }

  /** Null: as it is. */
  #missingWanted(method: string, palette_id: string): string | null {
    const { palettes, scene, hasThermal, missingIsAutomatic } = this.store;
    if (scene != null && !hasThermal) return 'visible';
    if (!missingIsAutomatic) return this.#chosenMissing;
    const palette = palettes.find(({ id }) => id === palette_id);
    if (palette === undefined) return null;
    return viewModeOf(method) === 'thermal' && hasThermal ? unmeasuredColour(palette) : 'visible';
  }

  /** A temperature that both methods have by the same name is the user's, not the method's: it goes along. */
  #sharedTemperatures(current: Fusion, method: string): Record<string, ParameterValue> {
    const { methods } = this.store;
    const temperatures = (id: string) =>
      (methods.find((one) => one.id === id)?.params ?? []).filter(({ kind }) => kind === 'temperature').map(({ name }) => name);
    const theirs = temperatures(method);
    const shared = temperatures(current.method).filter((name) => theirs.includes(name) && name in current.params);
    return Object.fromEntries(shared.map((name) => [name, current.params[name] ?? null]));
  }

  #rememberFused(fusion: Fusion): void {
    if (viewModeOf(fusion.method) === 'fused') this.#lastFusedMethod = fusion.method;
  }
}

/** Of two values that contradict each other, the one that somebody has just changed is refused, whichever the sentence begins with. */
function refusedField(field: string, { method, params }: FusionChange): string {
  const changed = Object.keys(params ?? {}).map((name) => `params.${name}`);
  const isOfAnother = method === undefined && field.startsWith('params.') && !changed.includes(field);
  return isOfAnother ? (changed.at(-1) ?? field) : field;
}
