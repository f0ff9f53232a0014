/**
 * The fusion library itself, compiled to WebAssembly: the same methods, the same checks and the same bytes as on the robot. What
 * a method is, is not known here: names and values go in as they came over the wire.
 */

import type { FusionChange, ParameterValue } from '../protocol/messages';
import { FusionRefusal } from './fusion_refusal';

/** What fusion/module/module.cpp exports; addresses are bytes from the start of its memory. */
interface Exports extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  _initialize(): void;
  allocate(bytes: number): number;
  release(address: number): void;
  text(): number;
  text_capacity(): number;
  text_length(): number;
  scene_summary(
    finite_count: number,
    missing_count: number,
    over_range_count: number,
    under_range_count: number,
    minimum: number,
    maximum: number,
    mean: number,
    sigma: number,
  ): void;
  scene_histogram(bins: number): number;
  hue_sectors(): number;
  scene_hues(): number;
  settings_reset(): void;
  change_begin(): void;
  change_method(end: number): void;
  change_palette(end: number): void;
  change_automatic(name_end: number): void;
  change_number(name_end: number, value: number): void;
  change_toggle(name_end: number, value: number): void;
  change_choice(name_end: number, value_end: number): void;
  change_range_auto(): void;
  change_range_manual(minimum: number, maximum: number): void;
  change_range_percentile(low: number, high: number): void;
  change_missing_visible(): void;
  change_missing_colour(r: number, g: number, b: number): void;
  change_apply(): number;
  error_field(): void;
  prepare(): number;
  palette(): number;
  prepare_with_palette(): number;
  wanted_bins(): number;
  wants_hues(): number;
  range_minimum(): number;
  range_maximum(): number;
  highlighted_count(): number;
  highlighted(): number;
  parameter_count(): number;
  parameter_name(index: number): void;
  parameter_kind(index: number): number;
  parameter_number(index: number): number;
  parameter_choice(index: number): void;
  parameter_in_force(index: number): number;
  fuse(temperature: number, visible: number, fused: number, count: number): void;
  fuse_codes(codes: number, scale: number, offset: number, visible: number, fused: number, count: number): void;
  fuse_codes_rgba(
    codes: number,
    scale: number,
    offset: number,
    visible: number,
    rgba: number,
    count: number,
    with_marks: number,
  ): void;
}

const FACTS_MISSING = -1;
const KIND_TOGGLE = 3;
const KIND_CHOICE = 4;
const KIND_AUTOMATIC = 0;

/** Facts of the temperatures of the whole scene. */
export interface SceneSummary {
  finite_count: number;
  missing_count: number;
  over_range_count: number;
  under_range_count: number;
  minimum: number;
  maximum: number;
  mean: number;
  sigma: number;
}

/** What is known of a scene: histograms of any numbers of bins, and the chroma of its hues. */
export interface SceneFacts {
  summary: SceneSummary;
  histograms: readonly (readonly number[])[];
  hues: readonly number[] | null;
}

/** What a plan wants to know of the scene beyond its summary: the histogram of so many bins, the chroma of its hues. */
export interface WantedFacts {
  bins: number | null;
  hues: boolean;
}

/** What follows from settings and scene. */
export interface PlanInForce {
  params: Record<string, ParameterValue>;
  params_in_force: Record<string, ParameterValue>;
  range_minimum: number;
  range_maximum: number;
  highlighted: [number, number][];
}

export class FusionModule {
  readonly #exports: Exports;
  readonly #text: number;

  private constructor(instance: WebAssembly.Instance) {
    this.#exports = instance.exports as Exports;
    this.#exports._initialize();
    this.#text = this.#exports.text();
  }

  /** Rejects when the machine cannot compile or start it. */
  static async from(bytes: BufferSource): Promise<FusionModule> {
    return new FusionModule((await WebAssembly.instantiate(bytes, {})).instance);
  }

  /** The same of a module that is compiled already, where the page may not wait. */
  static async instantiate(module: WebAssembly.Module): Promise<FusionModule> {
    return new FusionModule(await WebAssembly.instantiate(module, {}));
  }

  /** The same in a worker. */
  static start(module: WebAssembly.Module): FusionModule {
    return new FusionModule(new WebAssembly.Instance(module, {}));
  }

  /** All that is known of a scene. */
  setFacts({ summary, histograms, hues }: SceneFacts): void {
    this.setScene(summary);
    for (const counts of histograms) this.setHistogram(counts);
    if (hues !== null) this.setHues(hues);
  }

  /** Facts of a scene; histograms and hues of the one before are forgotten. */
  setScene(summary: SceneSummary): void {
    this.#exports.scene_summary(
      summary.finite_count,
      summary.missing_count,
      summary.over_range_count,
      summary.under_range_count,
      summary.minimum,
      summary.maximum,
      summary.mean,
      summary.sigma,
    );
  }

  setHistogram(counts: readonly number[]): void {
    const address = this.#exports.scene_histogram(counts.length);
    if (address === 0) throw new Error(`a histogram of ${counts.length} bins is more than the module takes`);
    new Float64Array(this.#exports.memory.buffer, address, counts.length).set(counts);
  }

  setHues(chroma: readonly number[]): void {
    const sectors = this.#exports.hue_sectors();
    if (chroma.length !== sectors) throw new Error(`${chroma.length} hue sectors, not ${sectors}`);
    new Float64Array(this.#exports.memory.buffer, this.#exports.scene_hues(), sectors).set(chroma);
  }

  /** Changes the settings as fusion.set does; throws FusionRefusal and leaves them as they were. */
  change(change: FusionChange): void {
    const module = this.#exports;
    module.change_begin();
    if (change.method !== undefined) module.change_method(this.#write(change.method));
    if (change.palette !== undefined) module.change_palette(this.#write(change.palette));
    for (const [name, value] of Object.entries(change.params ?? {})) {
      const end = this.#write(name);
      if (value === null) module.change_automatic(end);
      else if (typeof value === 'number') module.change_number(end, value);
      else if (typeof value === 'boolean') module.change_toggle(end, value ? 1 : 0);
      else module.change_choice(end, this.#write(value, end));
    }
    const { range, missing } = change;
    if (range?.mode === 'manual') module.change_range_manual(range.min ?? Number.NaN, range.max ?? Number.NaN);
    else if (range?.mode === 'percentile') module.change_range_percentile(range.low ?? Number.NaN, range.high ?? Number.NaN);
    else if (range !== undefined) module.change_range_auto();
    if (missing === 'visible') module.change_missing_visible();
    else if (missing !== undefined) {
      const rgb = Number.parseInt(missing.slice(1), 16);
      module.change_missing_colour((rgb >> 16) & 255, (rgb >> 8) & 255, rgb & 255);
    }
    this.#check(module.change_apply());
  }

  /** Back to the settings with which a file is fused where nothing else is said. */
  resetSettings(): void {
    this.#exports.settings_reset();
  }

  /**
   * Makes the settings ready for the scene. Facts of the scene that are wanted first are returned, null when it is ready; throws
   * FusionRefusal. `palette` takes the place of the one that is set: 256 rows of r, g, b.
   */
  prepare(palette?: Float64Array): WantedFacts | null {
    const module = this.#exports;
    let code: number;
    if (palette === undefined) code = module.prepare();
    else {
      new Float64Array(module.memory.buffer, module.palette(), 768).set(palette);
      code = module.prepare_with_palette();
    }
    if (code === FACTS_MISSING) {
      const bins = module.wanted_bins();
      return { bins: bins === 0 ? null : bins, hues: module.wants_hues() !== 0 };
    }
    this.#check(code);
    return null;
  }

  /** What follows from the settings for the scene; after prepare(). */
  plan(): PlanInForce {
    const module = this.#exports;
    const params: Record<string, ParameterValue> = {};
    const params_in_force: Record<string, ParameterValue> = {};
    for (let index = 0; index < module.parameter_count(); ++index) {
      module.parameter_name(index);
      const name = this.#read();
      const kind = module.parameter_kind(index);
      if (kind === KIND_CHOICE) {
        module.parameter_choice(index);
        params[name] = params_in_force[name] = this.#read();
      } else {
        const value = module.parameter_number(index);
        const resolved = module.parameter_in_force(index);
        params[name] = kind === KIND_AUTOMATIC ? null : kind === KIND_TOGGLE ? value !== 0 : value;
        params_in_force[name] = kind === KIND_TOGGLE ? resolved !== 0 : resolved;
      }
    }
    const edges = new Float64Array(module.memory.buffer, module.highlighted(), 2 * module.highlighted_count());
    const highlighted: [number, number][] = [];
    for (let i = 0; i < edges.length; i += 2) highlighted.push([edges[i]!, edges[i + 1]!]);
    return {
      params,
      params_in_force,
      range_minimum: module.range_minimum(),
      range_maximum: module.range_maximum(),
      highlighted,
    };
  }

  /** Memory of the module; throws when it has no more. */
  allocate(bytes: number): number {
    const address = this.#exports.allocate(Math.max(1, bytes));
    if (address === 0) throw new Error(`no ${bytes} bytes are left for fusing here`);
    return address;
  }

  release(address: number): void {
    this.#exports.release(address);
  }

  /** Bytes of the module's memory; good until the next allocate(). */
  bytes(address: number, count: number): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.#exports.memory.buffer as ArrayBuffer, address, count);
  }

  /** Fuses float32 temperatures and visible colours, three bytes each; addresses of the module's memory. */
  fuse(temperature: number, visible: number, fused: number, count: number): void {
    this.#exports.fuse(temperature, visible, fused, count);
  }

  /** The same of temperatures as 16-bit codes. */
  fuseCodes(codes: number, scale: number, offset: number, visible: number, fused: number, count: number): void {
    this.#exports.fuse_codes(codes, scale, offset, visible, fused, count);
  }

  /** Into red, green, blue, alpha; alpha is 0 where the method highlights, when `with_marks`. */
  fuseCodesRgba(
    codes: number,
    scale: number,
    offset: number,
    visible: number,
    rgba: number,
    count: number,
    with_marks: boolean,
  ): void {
    this.#exports.fuse_codes_rgba(codes, scale, offset, visible, rgba, count, with_marks ? 1 : 0);
  }

  #check(code: number): void {
    if (code === 0) return;
    const message = this.#read();
    this.#exports.error_field();
    throw new FusionRefusal(code, this.#read(), message);
  }

  /** Puts text into the module's buffer from `begin` on; returns where it ends. */
  #write(text: string, begin = 0): number {
    const bytes = new TextEncoder().encode(text);
    const end = begin + bytes.length;
    if (end > this.#exports.text_capacity()) throw new Error('a name is longer than the module takes');
    new Uint8Array(this.#exports.memory.buffer, this.#text).set(bytes, begin);
    return end;
  }

  #read(): string {
    return new TextDecoder().decode(new Uint8Array(this.#exports.memory.buffer, this.#text, this.#exports.text_length()));
  }
}
