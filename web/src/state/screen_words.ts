import { type DrawnError, worse } from '../tiles/tile_set';

/** What there is to say of a picture. */
export interface PictureWords {
  error: DrawnError | null;
  /** Methods that parts of it show, each as often as it likes. */
  methods: readonly string[];
}

/**
 * What may be said of the screen: pictures are drawn some time after they are put together, on a weak machine seconds later. Until then
 * the last one that has been drawn stands there: nothing better is said than of that one, and of those on their way.
 */
export class ScreenWords {
  #pictures: { picture: number; words: PictureWords }[] = [];

  /** Of the picture of this number, and of those after it. */
  pictureIs(picture: number, words: PictureWords): void {
    if (this.#pictures.at(-1)?.picture === picture) this.#pictures.pop();
    this.#pictures.push({ picture, words });
  }

  /** The pictures up to this number have been drawn. */
  afterPicture(drawn: number): { error: DrawnError | null; methods: string[] } {
    while (this.#pictures.length > 1 && this.#pictures[1]!.picture <= drawn) this.#pictures.shift();
    const all = this.#pictures.map(({ words }) => words);
    return {
      error: all.map(({ error }) => error).reduce(worse),
      methods: [...new Set(all.flatMap(({ methods }) => methods))].sort(),
    };
  }
}
