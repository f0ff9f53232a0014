import address from 'virtual:fusion-module';
import type { FusionModule, SceneFacts, WantedFacts } from '../fusion/fusion_module';
import { FusionRefusal } from '../fusion/fusion_refusal';
import { facts as factsReply, type Facts, type Fusion, type FusionChange } from '../protocol/messages';
import { BUSY, ConnectionLost, RpcError } from '../transport/connection';
import { wholeChange } from './fusion_change';
import type { Store } from './store.svelte';

/** Where the user wants colours to be made; automatic: here, where the link and the machine are fit for it. */
export type FusingWish = 'automatic' | 'here' | 'robot';

/** Why automatic stays with the robot. */
export type Unfit = 'machine' | 'map' | 'link' | 'unmeasured';

/** Longest time that raw layers may take over the link before they are left to whoever asks for them. */
export const LONGEST_RAW_S = 60;
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
/** Of the histogram that is got before it is needed, so that a lost link does not keep it away: that of percentiles, of which coarser ones are made. */
const BINS = 4096;
/** Histograms of other numbers of bins that are kept. */
const MOST_OTHERS = 8;
const BUSY_WAIT_MS = 300;
/** Codes of refusals for names that the library does not know: of a method, a parameter, a palette. */
const UNKNOWN = [100, 101, 105];
/** Raw layers are given up when nothing has come over the link for so long. */
export const LONGEST_PAUSE_MS = 20_000;

export interface FusingEvents {
  /** Asks the server; rejects with RpcError when it refuses. */
  request: (method: string, params: object) => Promise<unknown>;
  /** Other channels are wanted. */
  resubscribe: () => void;
  /** Settings are on their way to the server, or it has not answered yet. */
  isBusy: () => boolean;
  /** Of the settings that it has answered last. */
  answeredGeneration: () => number;
  /** All that has come over the link has been brought into the tiles. */
  isTakenIn: () => boolean;
  /** What a method highlights in the settings that are now in force here. */
  onHighlighted: (method: string, intervals: [number, number][]) => void;
  /** The next picture shows this method by what is here. */
  onShown: (method: string) => void;
  /** What is shown here is not what is set, and the robot is asked for it. */
  onBehind: () => void;
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
  rawCounts(asked_celsius: number): { drawn: number; raw: number; step_celsius: number; waiting: number };
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
  /** What draws has been given the library, which it may have still to get ready. */
  #isGiven = false;
  /** The newest that have come; of temperatures that have moved since, until others are there. */
  #facts: SceneFacts | null = null;
  /** Counts by their number of bins, and after how many moves of the temperatures they were asked for. */
  readonly #histograms = new Map<number, { counts: readonly number[]; move: number }>();
  #moves = 0;
  /** Another number of bins that the settings want. */
  #otherBins = BINS;
  /** Another scene has other facts. */
  #sceneNumber = 0;
  /** Whose facts are being asked for; -1: none. */
  #askingFor = -1;
  #wantsRaw = false;
  /** Since when nothing has come of the raw layers that are wanted; null: something has. */
  #pauseSince: number | null = null;
  /** Colours come from the robot again, and are still on their way. */
  #isLeaving = false;
  #isOfferedRaw = false;
  /** The coarsest in which temperatures of the picture have come, and of which scene, and which span of it, that was. */
  #step_celsius = 0;
  #stepOf = { scene: '', span_celsius: Infinity };
  /** Settings that the planner has, and why it does not take them; null: it does. */
  #given: { fusion: Fusion; error: unknown } | null = null;
  /** In which temperatures are asked for; it only gets finer. */
  #asked_celsius = USUAL_STEP_CELSIUS;

  constructor(
    private readonly store: Store,
    private readonly tiles: FusingTiles,
    private readonly picture: FusingPicture,
    private readonly events: FusingEvents,
    private readonly fetchModule: () => Promise<WebAssembly.Module> = compile,
    private readonly isBuilt: boolean = address !== null,
  ) {
    store.hasFusingLibrary = false;
  }

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
    // What is shown is made here, as long as nothing else comes; before anything is asked for it is decided anew whether that is to go on.
    this.#isLeaving = false;
    this.#wantsRaw ||= this.isHere;
    if (!this.#isOfferedRaw && this.#wantsRaw) this.#leaveAtOnce();
    if (this.isHere) this.consider();
    if (this.#wantsRaw) this.factsChanged();
  }

  /** There is no scene any more, or another one: its picture comes from the robot first. */
  sceneGone(): void {
    this.#sceneNumber += 1;
    // What could not be done with the other one.
    this.store.fusingProblem = null;
    this.#forgetFacts();
    this.#isLeaving = false;
    this.#asked_celsius = USUAL_STEP_CELSIUS;
    this.#leaveAtOnce();
  }

  /** The temperatures of the scene have moved: plans are made of other facts as soon as they are here, and of those that are here until then. */
  factsChanged(): void {
    this.#moves += 1;
    if (this.#wantsRaw) this.#askForFacts();
    else this.#forgetFacts();
  }

  /** What draws is ready to make colours. */
  drawerIsReady(): void {
    this.store.hasFusingLibrary = true;
    this.consider();
  }

  /** What draws cannot make colours; whoever wants them here again gives it the library anew. */
  drawerHasFailed(message: string): void {
    this.#isGiven = false;
    this.store.hasFusingLibrary = false;
    this.failed(`Fusing here has failed: ${message}`);
  }

  /** The library or a tile cannot be used here. */
  failed(message: string): void {
    this.store.fusingProblem = message;
    if (this.store.fusingPlace === 'robot') return;
    if (this.isHere) {
      this.events.onBehind();
      this.#leave();
    } else this.#leaveAtOnce();
  }

  /** All that was asked for of the robot, of this generation, is in the picture; on a map that changes all the time there may be newer ones already. */
  completed(generation: number): void {
    if (this.#isLeaving && generation >= this.events.answeredGeneration() && !this.events.isBusy()) {
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
    if (this.#isLeaving) {
      // Wanted again before the robot has brought its colours.
      const isReady = store.hasFusingLibrary && this.#facts !== null && counts.raw === counts.drawn;
      if (isReady && store.wanted === null && store.fusion !== null) this.#enter(store.fusion);
      return;
    }
    const isFiner = this.#asksFiner();
    if (!this.#wantsRaw) {
      if (!store.settled || !store.pictureStands) return;
      this.#wantsRaw = true;
      store.fusingPlace = 'coming';
      this.#load();
      this.#forgetFacts();
      this.#askForFacts();
      this.events.resubscribe();
      return;
    }
    if (isFiner) this.events.resubscribe();
    if (this.#isStuck(counts)) {
      this.failed('Raw values of a part of the picture do not come.');
      return;
    }
    if (store.fusingPlace !== 'coming') return;
    store.rawShare = counts.drawn === 0 ? 0 : counts.raw / counts.drawn;
    if (store.rawShare < 1 || !store.hasFusingLibrary || this.#facts === null) return;
    if (!store.settled || store.wanted !== null || this.events.isBusy() || store.fusion === null) return;
    this.#enter(store.fusion);
  }

  /**
   * Settings that are to be shown: what is in force then, when they are fused here; null when the robot is asked. Throws FusionRefusal
   * as the robot would refuse.
   */
  apply(wanted: Fusion): Fusion | null {
    if (this.store.fusingProblem !== null || !this.store.hasFusingLibrary || this.#facts === null) return null;
    if (!this.isHere && !this.#isAllHereWithoutLink()) return null;
    try {
      const change = wholeChange(wanted);
      const isLeft = this.#left(wanted) !== null;
      const inForce = isLeft ? null : this.#planned(wanted);
      if (isLeft || (inForce !== null && this.#leftToRobot(inForce) !== null)) {
        this.#leave();
        return null;
      }
      if (inForce === null) return null;
      this.picture.fuse(change);
      if (!this.isHere) this.#stay();
      else if (this.#isLeaving && this.#isWanted() && this.#isAllHere()) {
        this.#stay();
        this.events.resubscribe();
      }
      this.events.onShown(wanted.method);
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
    return store.fusingWish === 'here' || this.unfit === null;
  }

  /** Why the settings that are shown are the robot's; null: they can be made here. */
  get leftToRobot(): string | null {
    const { fusion } = this.store;
    return fusion === null ? null : this.#left(fusion);
  }

  #left(fusion: Fusion): string | null {
    return this.#leftToRobot(fusion) ?? this.#unknown(fusion);
  }

  /** Of a robot that has more than the library here. */
  #unknown(fusion: Fusion): string | null {
    if (!this.store.hasFusingLibrary || this.#planner === null) return null;
    const error = this.#give(this.#planner, fusion);
    return error instanceof FusionRefusal && UNKNOWN.includes(error.code) ? `Here ${error.message.split(';')[0]!}.` : null;
  }

  /** Returns why the planner does not take these settings; null: it has them. */
  #give(planner: FusionModule, fusion: Fusion): unknown {
    if (this.#given?.fusion !== fusion) {
      this.#given = { fusion, error: null };
      try {
        planner.resetSettings();
        planner.change(wholeChange(fusion));
      } catch (error) {
        this.#given.error = error;
      }
    }
    return this.#given.error;
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

  /** What automatic means: more than a tiny machine, a scene that does not grow, and a link over which raw layers come soon. Null: all is so. */
  get unfit(): Unfit | null {
    const { store } = this;
    const machine = navigator as Navigator & { deviceMemory?: number };
    if ((machine.hardwareConcurrency || 2) < 2 || (machine.deviceMemory ?? 4) < 2) return 'machine';
    if (store.scene?.live === true) return 'map';
    const rate = store.stats?.throughput_bytes_per_s ?? null;
    if (this.#wantsRaw) return null;
    if (rate === null) return 'unmeasured';
    return store.costs.raw_bytes / rate <= LONGEST_RAW_S ? null : 'link';
  }

  /** The settings in force, with what the library makes of what is automatic; null when the robot has to make them. */
  #planned(wanted: Fusion): Fusion | null {
    const planner = this.#planner!;
    const error = this.#give(planner, wanted);
    if (error !== null) throw error;
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

  /** Asks for what a plan lacks; what is shown stays until it is there, or until there is a link again. */
  #lacks({ bins }: WantedFacts): void {
    this.#otherBins = bins ?? BINS;
    if (this.store.connected) this.#askForFacts();
  }

  #enter(fusion: Fusion): void {
    try {
      if (this.#planned(fusion) === null) return;
      this.picture.fuse(wholeChange(fusion));
    } catch (error) {
      this.failed(messageOf(error));
      return;
    }
    this.#stay();
    this.events.onShown(fusion.method);
    this.events.resubscribe();
  }

  #stay(): void {
    this.#isLeaving = false;
    this.#wantsRaw = true;
    this.store.fusingPlace = 'here';
    this.tiles.setHere(true);
  }

  /** The link is lost while the robot made the colours, and all that is drawn could be fused here. */
  #isAllHereWithoutLink(): boolean {
    return !this.store.connected && this.#isAllHere();
  }

  #isAllHere(): boolean {
    const { drawn, raw } = this.tiles.rawCounts(this.#asked_celsius);
    return drawn > 0 && raw === drawn;
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
    this.store.factsSince = null;
    if (wasHere) {
      this.tiles.setHere(false);
      this.picture.fuse(null);
      this.events.onLeft();
    }
    if (wasSubscribed && this.store.connected) this.events.resubscribe();
  }

  #load(): void {
    if (this.#compiled !== null) this.#startDrawer(this.#compiled);
    if (this.#isLoading || this.#compiled !== null) return;
    this.#isLoading = true;
    // Nothing of it belongs to the first picture.
    Promise.all([this.fetchModule(), import('../fusion/fusion_module')])
      .then(async ([compiled, { FusionModule }]) => {
        this.#planner = await FusionModule.instantiate(compiled);
        this.#compiled = compiled;
        this.#startDrawer(compiled);
        this.#spread();
      })
      .catch((error: unknown) => this.failed(`The library for fusing here could not be loaded: ${messageOf(error)}`))
      .finally(() => {
        this.#isLoading = false;
      });
  }

  #startDrawer(compiled: WebAssembly.Module): void {
    if (this.#isGiven) return;
    this.#isGiven = true;
    this.picture.startFusing(compiled);
  }

  /** Some of what is drawn, or is to be, waits for raw layers though the link has been silent for long. */
  #isStuck({ drawn, raw, waiting }: { drawn: number; raw: number; waiting: number }): boolean {
    const { store } = this;
    const isWaiting =
      store.rate_bytes_per_s === 0 &&
      store.silentFor_s === null &&
      this.events.isTakenIn() &&
      !this.#isLeaving &&
      (this.isHere ? waiting > 0 : store.settled && raw < drawn);
    const now = performance.now();
    this.#pauseSince = isWaiting ? (this.#pauseSince ?? now) : null;
    return this.#pauseSince !== null && now - this.#pauseSince > LONGEST_PAUSE_MS;
  }

  #forgetFacts(): void {
    this.#facts = null;
    this.#histograms.clear();
    this.#otherBins = BINS;
  }

  #askForFacts(): void {
    if (this.isHere && this.store.connected) this.store.factsSince ??= performance.now();
    void this.#askFacts();
  }

  /** Of which number of bins to ask next: the one that is lacking, or of the oldest temperatures; null: all that is wanted is here. */
  get #nextBins(): number | null {
    const moveOf = (bins: number) => this.#histograms.get(bins)?.move ?? -1;
    const old = [BINS, this.#otherBins].filter((bins) => moveOf(bins) < this.#moves).sort((a, b) => moveOf(a) - moveOf(b));
    return old[0] ?? null;
  }

  /** Facts that come are used at once, whatever has moved meanwhile; then they are asked for again. */
  async #askFacts(): Promise<void> {
    const scene = this.#sceneNumber;
    if (this.#askingFor === scene) return;
    this.#askingFor = scene;
    try {
      for (let bins = this.#nextBins; bins !== null && this.#wantsRaw; bins = this.#nextBins) {
        const move = this.#moves;
        const reply = await this.#factsOf(bins);
        if (scene !== this.#sceneNumber) return;
        const { min, max, counts = [], hues = this.#facts?.hues ?? null, ...rest } = reply;
        this.#histograms.set(bins, { counts, move });
        if (bins !== BINS)
          this.store.fusingCount = { method: this.store.fusion?.method ?? '', bytes: JSON.stringify(reply).length };
        // What the settings want of the others they say again.
        if (bins === BINS) this.#otherBins = BINS;
        const others = [...this.#histograms].filter(([other]) => other !== BINS);
        for (const [i, [other, one]] of others.entries())
          if ((bins === BINS && one.move < move) || i < others.length - MOST_OTHERS) this.#histograms.delete(other);
        const histograms = [...this.#histograms.values()].flatMap((one) => coarserCounts(one.counts));
        this.#facts = { summary: { ...rest, minimum: min, maximum: max }, histograms, hues };
        this.#spread();
      }
    } catch (error) {
      if (scene === this.#sceneNumber && !(error instanceof ConnectionLost)) this.failed(messageOf(error));
    } finally {
      if (scene === this.#sceneNumber) {
        this.#askingFor = -1;
        this.store.factsSince = null;
      }
    }
  }

  async #factsOf(bins: number): Promise<Facts> {
    for (const start = performance.now(); ;) {
      try {
        return factsReply(
          await this.events.request('fusion.facts', { bins, ...(bins === BINS ? { hues: true } : {}) }),
          'fusion.facts',
        );
      } catch (error) {
        if (!(error instanceof RpcError) || error.code !== BUSY) throw error;
        if (performance.now() - start > LONGEST_PAUSE_MS) throw new Error('The robot is too busy to say what it has counted.');
        await new Promise((resolve) => setTimeout(resolve, BUSY_WAIT_MS));
      }
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
    } catch {
      // The robot refuses it, too, and says so.
    }
  }
}

/** The same counts, and those of half as many bins, of a quarter and so on: each of these bins is exactly two of those. */
function coarserCounts(counts: readonly number[]): (readonly number[])[] {
  const all = [counts];
  for (let finest = counts; finest.length % 2 === 0 && finest.length > 0;) {
    const pairs = finest;
    finest = Array.from({ length: pairs.length / 2 }, (_, i) => pairs[2 * i]! + pairs[2 * i + 1]!);
    all.push(finest);
  }
  return all;
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
