import type { CameraPose, Extreme, Extremes, Vec3 } from '../protocol/messages';

/** The part of the viewport that is needed to mark places. */
export interface Marking {
  readonly pose: CameraPose;
  readonly size: [number, number];
  project(point: Vec3): { x: number; y: number; depth: number } | null;
  pick(x: number, y: number, reach_px: number): Promise<Vec3 | null>;
}

/** How far what is drawn at a place may be from the place itself, metres; `depth`: distance from the camera. */
export type Tolerance = (depth: number) => number;

/** Left, top, right and bottom of the part of the picture that no control covers, as shares of its width and height. */
export type Window = [number, number, number, number];

/** The hottest and the coldest of what is seen in a window of the picture; null: nobody can say. */
export type AskInView = (camera: CameraPose, window: Window) => Promise<Extremes | null>;

export type Kind = 'hottest' | 'coldest';

/** A hottest or a coldest place, as it stands on the screen. */
export interface Mark {
  kind: Kind;
  /** Of the whole scene, or of what is on the screen. */
  of: 'scene' | 'view';
  temperature: number;
  x: number;
  y: number;
  /** Something is drawn in front of it. */
  isHidden: boolean;
}

/** The hottest or the coldest place: one beyond what the sensor could tell (an infinite temperature) comes before all others. */
export function extremeOf(extremes: Extremes | null, kind: Kind): Extreme | null {
  const beyond = kind === 'hottest' ? extremes?.over_range : extremes?.under_range;
  if (beyond != null) return { position: beyond, temperature: kind === 'hottest' ? Infinity : -Infinity };
  return extremes?.[kind] ?? null;
}

/** Casting rays through the scene is work, and so is finding what is seen: it waits until the camera rests. */
const REST_MS = 250;
/** Radius of the points of a cloud that may hide a marked place. */
export const MARK_REACH_PX = 1.5;
/** Tangent of the flattest angle at which a sheet of points is looked at and still hides nothing of itself. */
export const FLATTEST = 1 / 4;
const KINDS = ['hottest', 'coldest'] as const;

/** Marks the hottest and the coldest place of the scene, and of what is on the screen once the camera rests. */
export class Markers {
  #extremes: Extremes | null = null;
  /** Of what is on the screen, and from where that was. */
  #inView: { extremes: Extremes; from: string } | null = null;
  #window: Window = [0, 0, 1, 1];
  #hidden = new Set<Kind>();
  #timer: ReturnType<typeof setTimeout> | undefined;
  #check = 0;

  constructor(
    private readonly viewport: Marking,
    private readonly tolerance_m: Tolerance,
    private readonly askInView: AskInView,
    private readonly onMarks: (marks: Mark[]) => void,
  ) {}

  extremesAre(extremes: Extremes | null): void {
    this.#extremes = extremes;
    this.#inView = null;
    this.#hidden.clear();
    this.update();
  }

  windowIs(window: Window): void {
    this.#window = window;
    this.update();
  }

  /** The camera has moved, or the picture has changed. */
  update(): void {
    // What was the hottest on the screen need not be so any more.
    if (this.#inView !== null && this.#inView.from !== this.#here) this.#inView = null;
    this.onMarks(this.#marks());
    clearTimeout(this.#timer);
    this.#check += 1;
    if (this.#extremes !== null) this.#timer = setTimeout(() => void this.#look(), REST_MS);
  }

  dispose(): void {
    clearTimeout(this.#timer);
    this.#check += 1;
  }

  get #here(): string {
    return JSON.stringify([this.viewport.pose, this.#window]);
  }

  #placeOf(extreme: Extreme): { x: number; y: number; depth: number } | null {
    const [width, height] = this.viewport.size;
    const place = this.viewport.project(extreme.position);
    return place === null || place.x < 0 || place.y < 0 || place.x > width || place.y > height ? null : place;
  }

  #marks(): Mark[] {
    const [hottest, coldest] = KINDS.map((kind) => extremeOf(this.#extremes, kind));
    // Where all is of one temperature, no place is the hottest.
    if (hottest != null && hottest.temperature === coldest?.temperature) return [];
    const mark = (kind: Kind, of: Mark['of'], extreme: Extreme): Mark[] => {
      const place = this.#placeOf(extreme);
      if (place === null) return [];
      const isHidden = of === 'scene' && this.#hidden.has(kind);
      return [{ kind, of, temperature: extreme.temperature, x: place.x, y: place.y, isHidden }];
    };
    return KINDS.flatMap((kind) => {
      const whole = extremeOf(this.#extremes, kind);
      const seen = extremeOf(this.#inView?.extremes ?? null, kind);
      // Where the scene's own is seen, one mark says both.
      const isSame = whole !== null && seen !== null && String(whole.position) === String(seen.position);
      return [
        ...(whole === null ? [] : mark(kind, 'scene', whole)),
        ...(seen === null || isSame ? [] : mark(kind, 'view', seen)),
      ];
    });
  }

  async #look(): Promise<void> {
    const check = this.#check;
    const hidden = new Set<Kind>();
    for (const kind of KINDS) {
      const extreme = extremeOf(this.#extremes, kind);
      const place = extreme && this.#placeOf(extreme);
      if (extreme === null || place === null) continue;
      const hit = await this.viewport.pick(place.x, place.y, MARK_REACH_PX);
      if (check !== this.#check) return;
      const { eye } = this.viewport.pose;
      const away = (point: Vec3) => Math.hypot(point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]);
      if (hit !== null && away(hit) < away(extreme.position) - this.tolerance_m(place.depth)) hidden.add(kind);
    }
    this.#hidden = hidden;
    this.onMarks(this.#marks());
    const from = this.#here;
    if (this.#inView?.from === from) return;
    const extremes = await this.askInView(this.viewport.pose, this.#window);
    if (check !== this.#check || extremes === null) return;
    this.#inView = { extremes, from };
    this.onMarks(this.#marks());
  }
}
