import { FusionModule, type SceneFacts } from '../fusion/fusion_module';
import type { FusionChange } from '../protocol/messages';
import type { RawArrays } from './render_messages';

/** Fuses tiles with the library, one after the other. What it throws says why it cannot. */
export class TileFuser {
  readonly #module: FusionModule;
  #isReady = false;
  /** Room for the largest tile so far: codes, visible colours, fused ones. */
  #room = { vertices: 0, codes: 0, rgb: 0, rgba: 0 };

  constructor(module: WebAssembly.Module) {
    this.#module = FusionModule.start(module);
  }

  /** Of those that were set with others colours go on to be made, until settings are set again. */
  setFacts(facts: SceneFacts): void {
    this.#module.setFacts(facts);
  }

  /** Settings as a whole, for the facts that were set. */
  setSettings(settings: FusionChange): void {
    this.#isReady = false;
    this.#module.resetSettings();
    this.#module.change(settings);
    if (this.#module.prepare() !== null) throw new Error('facts of the scene are not there');
    this.#isReady = true;
  }

  /** Writes red, green, blue and alpha of every vertex. */
  fuse({ codes, scale, offset, rgb }: RawArrays, rgba: Uint8Array, withMarks: boolean): void {
    if (!this.#isReady) throw new Error('there are no settings to fuse with');
    const count = codes.length;
    if (rgb.length !== 3 * count || rgba.length !== 4 * count) throw new Error('raw layers of different lengths');
    const room = this.#roomFor(count);
    const module = this.#module;
    module.bytes(room.codes, 2 * count).set(new Uint8Array(codes.buffer, codes.byteOffset, 2 * count));
    module.bytes(room.rgb, 3 * count).set(rgb);
    module.fuseCodesRgba(room.codes, scale, offset, room.rgb, room.rgba, count, withMarks);
    rgba.set(module.bytes(room.rgba, 4 * count));
  }

  #roomFor(vertices: number): { codes: number; rgb: number; rgba: number } {
    if (vertices <= this.#room.vertices) return this.#room;
    const module = this.#module;
    if (this.#room.vertices > 0)
      for (const address of [this.#room.codes, this.#room.rgb, this.#room.rgba]) module.release(address);
    this.#room = { vertices: 0, codes: 0, rgb: 0, rgba: 0 };
    // A little more, so that tiles of about the same size do not make it grow one by one.
    const size = Math.ceil(vertices * 1.25);
    const [codes, rgb, rgba] = [module.allocate(2 * size), module.allocate(3 * size), module.allocate(4 * size)];
    this.#room = { vertices: size, codes, rgb, rgba };
    return this.#room;
  }
}
