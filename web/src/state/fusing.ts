import address from 'virtual:fusion-module';
import type { FusionModule, SceneFacts, WantedFacts } from '../fusion/fusion_module';
import { FusionRefusal } from '../fusion/fusion_refusal';
import { facts as factsReply, type Fusion, type FusionChange } from '../protocol/messages';
import { wholeChange } from './fusion_change';
import type { Store } from './store.svelte';

/** Where the user wants colours to be made; automatic: here, where the link and the machine are fit for it. */
export type FusingWish = 'automatic' | 'here' | 'robot';

/** Longest time that raw layers may take over the link before they are left to whoever asks for them. */
export const LONGEST_RAW_S = 60;
/** Bytes of both raw layers for each vertex, about; the castle of 990,044 vertices takes 2.09 MB. */
export const RAW_BYTES_PER_VERTEX = 2.1;
/** Of a change of fused colours. */
export const CHANGE_BYTES_PER_VERTEX = 1.6;
/** Temperatures come here in steps, of which a range needs so many: half of one is then half a level of 256 at most. */
const STEPS_OF_A_RANGE = 256;
/** The step that the robot chooses unless a tile spans too much for it. */
const USUAL_STEP_CELSIUS = 0.01;
/** A narrower range gets a finer step, and so many of those, so that the next one that is a little narrower needs no other. */
const FINER_STEPS_OF_A_RANGE = 4 * STEPS_OF_A_RANGE;
/** A step of 32 bits is the same as that which was asked for. */
const SAME = 1.0001;
/** Of the span of a scene's temperatures: what stood far out is gone; the ends of a map that grows move by less all the time. */
const NARROWED_SPAN = 7 / 8;
/** Histograms that are got before they are needed, so that a lost link does not keep them away: of percentiles, and of bins by default. */
const EARLY_BINS = [4096, 64];

export interface FusingEvents {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  /** Other channels are wanted. */
  resubscribe: () => void;
  /** Settings are on their way to the server, or it has not answered yet. */
  isBusy: () => boolean;
  /** What a method highlights in the settings that are now in force here. */
  onHighlighted: (method: string, intervals: [number, number][]) => void;
  /** Colours are not made here any more, and the robot's settings are those that count. */
  onLeft: () => void;
}

/** What fusing needs of the picture. */
export interface FusingPicture {
  startFusing(module: WebAssembly.Module): void;
  setFacts(facts: SceneFacts): void;
  fuse(settings: FusionChange | null): void;
}

export interface FusingTiles {
  rawCounts(asked_celsius: number): { drawn: number; raw: number; step_celsius: number };
  setHere(isHere: boolean): void;
}

/**
 * Decides where colours are made. The first picture comes from the robot. Then, where it is wanted, raw layers follow in idle link time;
 * when every tile that is drawn has them, all of the picture is fused here: a setting costs no byte, and none of the picture shows another one.
 * What the library is unable to do here is left to the robot, and that is said.
 */
export class Fusing {
  #compiled: WebAssembly.Module | null = null;
  /** Of the page: makes plans. That of what draws makes colours. */
  #planner: FusionModule | null = null;
  #isLoading = false;
  #facts: SceneFacts | null = null;
  #factsNumber = 0;
  #isAskingFacts = false;
  #wantsRaw = false;
  /** Colours come from the robot again, and are still on their way. */
  #isLeaving = false;
  #isOfferedRaw = false;
  /** The coarsest in which temperatures of the picture have come, and of which scene, and which span of it, that was. */
  #step_celsius = 0;
  #stepOf = { scene: '', span_celsius: Infinity };
  /** In which temperatures are asked for; it only gets finer. */
  #asked_celsius = USUAL_STEP_CELSIUS;

  constructor(
    private readonly store: Store,
    private readonly tiles: FusingTiles,
    private readonly picture: FusingPicture,
    private readonly events: FusingEvents,
    private readonly fetchModule: () => Promise<WebAssembly.Module> = compile,
    private readonly isBuilt: boolean = address !== null,
  ) {}

  /** What scene.subscribe asks for. */
  get channels(): string[] {
    const raw = this.#wantsRaw ? ['temperature', 'visible'] : [];
    return this.isHere && !this.#isLeaving ? raw : ['fused', ...raw];
  }

  /** The same: in what steps temperatures are to come; undefined: as usual. */
  get step_celsius(): number | undefined {
    return this.#asked_celsius < USUAL_STEP_CELSIUS ? this.#asked_celsius : undefined;
  }

  get isHere(): boolean {
    return this.store.fusingPlace === 'here';
  }

  setWish(wish: FusingWish): void {
    this.store.fusingWish = wish;
    // Whoever asks again, tries again.
    this.store.fusingProblem = null;
    this.#step_celsius = 0;
    this.consider();
  }

  /** A new connection, whose scene is known. */
  greeted(capabilities: readonly string[]): void {
    this.#isOfferedRaw = capabilities.includes('raw_layers');
    this.#isLeaving = false;
    if (!this.#isOfferedRaw && this.#wantsRaw) this.#leaveAtOnce();
    if (this.#wantsRaw) this.factsChanged();
  }

  /** There is no scene any more, or another one: its picture comes from the robot first. */
  sceneGone(): void {
    this.#facts = null;
    this.#factsNumber += 1;
    this.#isAskingFacts = false;
    this.#isLeaving = false;
    this.#asked_celsius = USUAL_STEP_CELSIUS;
    this.#leaveAtOnce();
  }

  /** The temperatures of the scene have moved: plans are made of other facts. */
  factsChanged(): void {
    this.#facts = null;
    this.#factsNumber += 1;
    this.#isAskingFacts = false;
    if (this.#wantsRaw) void this.#askFacts(EARLY_BINS, true);
  }

  /** The library or a tile cannot be used here. */
  failed(message: string): void {
    this.store.fusingProblem = message;
    if (this.store.fusingPlace === 'robot') return;
    if (this.isHere) this.#leave();
    else this.#leaveAtOnce();
  }

  /** All that was asked for of the robot is in the picture. */
  completed(): void {
    if (this.#isLeaving && !this.events.isBusy()) {
      this.#isLeaving = false;
      this.#leaveAtOnce();
    }
    this.consider();
  }

  /** Called a few times a second, and when something has changed. */
  consider(): void {
    const { store } = this;
    if (!store.connected || store.scene == null || !this.#isOfferedRaw) return;
    const { name, temperature } = store.scene;
    const { min = null, max = null } = temperature ?? {};
    const span_celsius = min === null || max === null ? Infinity : max - min;
    const isNarrow = span_celsius < NARROWED_SPAN * this.#stepOf.span_celsius;
    if (name !== this.#stepOf.scene || (this.#step_celsius > 0 && isNarrow)) this.#step_celsius = 0;
    this.#stepOf.scene = name;
    const counts = this.tiles.rawCounts(this.#asked_celsius);
    if (this.#wantsRaw && counts.raw > 0) {
      this.#step_celsius = counts.step_celsius;
      this.#stepOf.span_celsius = span_celsius;
    }
    if (!this.#isWanted()) {
      if (this.isHere) this.#leave();
      else if (this.#wantsRaw) this.#leaveAtOnce();
      return;
    }
    const isFiner = this.#asksFiner();
    if (!this.#wantsRaw) {
      if (!store.settled || !store.pictureStands) return;
      this.#wantsRaw = true;
      store.fusingPlace = 'coming';
      this.#load();
      this.factsChanged();
      this.events.resubscribe();
      return;
    }
    if (isFiner) this.events.resubscribe();
    if (store.fusingPlace !== 'coming') return;
    store.rawShare = counts.drawn === 0 ? 0 : counts.raw / counts.drawn;
    if (store.rawShare < 1 || this.#planner === null || this.#facts === null) return;
    if (!store.settled || store.wanted !== null || this.events.isBusy() || store.fusion === null) return;
    this.#enter(store.fusion);
  }

  /**
   * Settings that are to be shown: what is in force then, when they are fused here; null when the robot is asked. Throws FusionRefusal
   * as the robot would refuse.
   */
  apply(wanted: Fusion): Fusion | null {
    if (this.store.fusingProblem !== null || this.#planner === null || this.#facts === null) return null;
    if (!this.isHere && !this.#isAllHereWithoutLink()) return null;
    try {
      const change = wholeChange(wanted);
      const inForce = this.#leftToRobot(wanted) === null ? this.#planned(wanted, change) : null;
      if (this.#leftToRobot(inForce ?? wanted) !== null) {
        this.#leave();
        return null;
      }
      if (inForce === null) return null;
      this.picture.fuse(change);
      if (!this.isHere) this.#stay();
      return inForce;
    } catch (error) {
      if (error instanceof FusionRefusal) throw error;
      this.failed(messageOf(error));
      return null;
    }
  }

  #isWanted(): boolean {
    const { store } = this;
    if (store.fusingProblem !== null || store.fusingWish === 'robot' || !store.hasThermal || !this.isPossible) return false;
    if (this.leftToRobot !== null) return false;
    return store.fusingWish === 'here' || this.#isFit();
  }

  /** Why the settings that are shown are the robot's; null: they can be made here. */
  get leftToRobot(): string | null {
    const { fusion } = this.store;
    return fusion === null ? null : this.#leftToRobot(fusion);
  }

  #leftToRobot({ method, age, range }: Fusion): string | null {
    const description = this.store.methods.find(({ id }) => id === method);
    if (description?.compares_with_baseline === true)
      return `${description.label} compares with temperatures of before, which the robot has.`;
    if (age?.mode === 'fade') return 'What is old fades by the time when it was seen, which the robot has.';
    const step = this.#step_celsius;
    const { min, max } = range;
    const isNarrow = step > this.#asked_celsius * SAME && min !== null && max !== null && step * STEPS_OF_A_RANGE > max - min;
    // What stands between two temperatures of such a map does not stand on the right side of each.
    const hasThreshold =
      step > USUAL_STEP_CELSIUS * SAME && description?.params.some(({ kind }) => kind === 'temperature') === true;
    if (!isNarrow && !hasThreshold) return null;
    const why = `Some temperatures come here in steps of ${Number(step.toPrecision(2))} °C, as those of one place span so much`;
    return `${why}: too coarse for ${isNarrow ? 'this range' : 'a threshold'}.`;
  }

  /** Asks for finer steps where the range that is set needs them. Whether it does that now. */
  #asksFiner(): boolean {
    const { min = null, max = null } = this.store.fusion?.range ?? {};
    const span = min === null || max === null ? 0 : max - min;
    if (span <= 0 || span >= this.#asked_celsius * STEPS_OF_A_RANGE) return false;
    const least = FINER_STEPS_OF_A_RANGE / span;
    const decade = 10 ** Math.ceil(Math.log10(least));
    // Whole parts of a degree, so that round temperatures come as they are.
    this.#asked_celsius = 1 / [decade / 5, decade / 2, decade].find((per_degree) => per_degree >= least)!;
    return true;
  }

  /** There is a library, and the robot gives what it needs. */
  get isPossible(): boolean {
    return this.isBuilt && this.#isOfferedRaw && typeof WebAssembly === 'object';
  }

  /** What automatic means: more than a tiny machine, a scene that does not grow, and a link over which raw layers come soon. */
  #isFit(): boolean {
    const { store } = this;
    const machine = navigator as Navigator & { deviceMemory?: number };
    if ((machine.hardwareConcurrency || 2) < 2 || (machine.deviceMemory ?? 4) < 2 || store.scene?.live === true) return false;
    if (this.#wantsRaw) return true;
    const rate = store.stats?.throughput_bytes_per_s ?? null;
    return rate !== null && (store.shown.vertices * RAW_BYTES_PER_VERTEX) / rate <= LONGEST_RAW_S;
  }

  /** The settings in force, with what the library makes of what is automatic; null when the robot has to make them. */
  #planned(wanted: Fusion, change: FusionChange): Fusion | null {
    const planner = this.#planner!;
    planner.resetSettings();
    planner.change(change);
    const lacking = planner.prepare();
    if (lacking !== null) {
      this.#lacks(lacking);
      return null;
    }
    const plan = planner.plan();
    this.events.onHighlighted(wanted.method, plan.highlighted);
    const range = { ...wanted.range, min: plan.range_minimum, max: plan.range_maximum };
    return { ...wanted, params: plan.params, params_in_force: plan.params_in_force, range };
  }

  /** Asks for what a plan lacks; the settings go the robot's way until it is there, or wait where there is no link. */
  #lacks({ bins, hues }: WantedFacts): void {
    if (this.store.connected) void this.#askFacts(bins === null ? [] : [bins], hues);
  }

  #enter(fusion: Fusion): void {
    const change = wholeChange(fusion);
    try {
      if (this.#planned(fusion, change) === null) return;
      this.picture.fuse(change);
    } catch (error) {
      this.failed(messageOf(error));
      return;
    }
    this.#stay();
    this.events.resubscribe();
  }

  #stay(): void {
    this.#wantsRaw = true;
    this.store.fusingPlace = 'here';
    this.tiles.setHere(true);
  }

  /** The link is lost while the robot made the colours, and all that is drawn could be fused here. */
  #isAllHereWithoutLink(): boolean {
    const { drawn, raw } = this.tiles.rawCounts(this.#asked_celsius);
    return !this.store.connected && drawn > 0 && raw === drawn;
  }

  /** The robot makes colours again; until they are there what is here is shown, in the same settings. */
  #leave(): void {
    if (this.#isLeaving) return;
    if (!this.store.connected) return;
    this.#isLeaving = true;
    this.#wantsRaw = false;
    this.events.resubscribe();
  }

  #leaveAtOnce(): void {
    const wasSubscribed = this.#wantsRaw;
    const wasHere = this.isHere;
    this.#wantsRaw = false;
    this.store.fusingPlace = 'robot';
    if (wasHere) {
      this.tiles.setHere(false);
      this.picture.fuse(null);
      this.events.onLeft();
    }
    if (wasSubscribed && this.store.connected) this.events.resubscribe();
  }

  #load(): void {
    if (this.#isLoading || this.#compiled !== null) return;
    this.#isLoading = true;
    // Nothing of it belongs to the first picture.
    Promise.all([this.fetchModule(), import('../fusion/fusion_module')])
      .then(async ([compiled, { FusionModule }]) => {
        this.#planner = await FusionModule.instantiate(compiled);
        this.#compiled = compiled;
        this.picture.startFusing(compiled);
        this.#spread();
      })
      .catch((error: unknown) => this.failed(`The library for fusing here could not be loaded: ${messageOf(error)}`))
      .finally(() => {
        this.#isLoading = false;
      });
  }

  async #askFacts(bins: readonly number[], wantsHues: boolean): Promise<void> {
    if (this.#isAskingFacts) return;
    this.#isAskingFacts = true;
    const number = this.#factsNumber;
    try {
      const ask = async (params: object) => factsReply(await this.events.request('fusion.facts', params), 'fusion.facts');
      const replies = [...(wantsHues ? [await ask({ hues: true })] : [])];
      for (const count of bins) replies.push(await ask({ bins: count }));
      if (number !== this.#factsNumber) return;
      const last = replies.at(-1)!;
      const { min, max, ...rest } = last;
      const histograms = [
        ...(this.#facts?.histograms ?? []).filter((one) => !bins.includes(one.length)),
        ...replies.flatMap(({ counts }) => (counts === undefined ? [] : [counts])),
      ];
      const hues = replies.find((reply) => reply.hues !== undefined)?.hues ?? this.#facts?.hues ?? null;
      const { counts: _counts, hues: _hues, ...summary } = rest;
      this.#facts = { summary: { ...summary, minimum: min, maximum: max }, histograms, hues };
      this.#spread();
    } catch (error) {
      if (number === this.#factsNumber && this.store.connected) this.failed(messageOf(error));
    } finally {
      if (number === this.#factsNumber) this.#isAskingFacts = false;
    }
  }

  /** Both sides know the same; what is shown here is shown by it. */
  #spread(): void {
    if (this.#facts === null || this.#planner === null) return;
    this.#planner.setFacts(this.#facts);
    this.picture.setFacts(this.#facts);
    const { fusion } = this.store;
    if (!this.isHere || fusion === null) return;
    try {
      const inForce = this.apply(fusion);
      if (inForce !== null) this.store.fusionInForce = inForce;
    } catch (error) {
      this.failed(messageOf(error));
    }
  }
}

async function compile(): Promise<WebAssembly.Module> {
  if (address === null) throw new Error('this program was built without it');
  const response = await fetch(address);
  if (!response.ok) throw new Error(`HTTP ${response.status}`);
  return WebAssembly.compile(await response.arrayBuffer());
}

function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
