import type { Extreme, Extremes, Vec3 } from '../protocol/messages';

/** The part of the viewport that is needed to mark places. */
export interface Marking {
  readonly pose: { eye: Vec3; target: Vec3 };
  readonly size: [number, number];
  project(point: Vec3): { x: number; y: number; depth: number } | null;
  pick(x: number, y: number): Promise<Vec3 | null>;
}

/** How far what is drawn at a place may be from the place itself, metres; `depth`: distance from the camera. */
export type Tolerance = (depth: number) => number;

/** The hottest or the coldest place of the scene, as it stands on the screen. */
export interface Mark {
  kind: keyof Extremes;
  temperature: number;
  x: number;
  y: number;
  /** Something is drawn in front of it. */
  isHidden: boolean;
}

/** Casting rays through the scene is work: it waits until the camera rests. */
const REST_MS = 250;

/** Marks the hottest and the coldest place of the scene on the screen. */
export class Markers {
  #extremes: Extremes | null = null;
  #hidden = new Set<keyof Extremes>();
  #timer: ReturnType<typeof setTimeout> | undefined;
  #check = 0;

  constructor(
    private readonly viewport: Marking,
    private readonly tolerance_m: Tolerance,
    private readonly onMarks: (marks: Mark[]) => void,
  ) {}

  extremesAre(extremes: Extremes | null): void {
    this.#extremes = extremes;
    this.#hidden.clear();
    this.update();
  }

  /** The camera has moved, or the picture has changed. */
  update(): void {
    this.onMarks(this.#marks());
    clearTimeout(this.#timer);
    this.#check += 1;
    if (this.#extremes !== null) this.#timer = setTimeout(() => void this.#look(), REST_MS);
  }

  dispose(): void {
    clearTimeout(this.#timer);
    this.#check += 1;
  }

  #places(): { kind: keyof Extremes; extreme: Extreme; x: number; y: number; depth: number }[] {
    const [width, height] = this.viewport.size;
    return (['hottest', 'coldest'] as const).flatMap((kind) => {
      const extreme = this.#extremes?.[kind] ?? null;
      const place = extreme === null ? null : this.viewport.project(extreme.position);
      if (extreme === null || place === null) return [];
      if (place.x < 0 || place.y < 0 || place.x > width || place.y > height) return [];
      return [{ kind, extreme, ...place }];
    });
  }

  #marks(): Mark[] {
    return this.#places().map(({ kind, extreme, x, y }) => ({
      kind,
      temperature: extreme.temperature,
      x,
      y,
      isHidden: this.#hidden.has(kind),
    }));
  }

  async #look(): Promise<void> {
    const check = this.#check;
    const hidden = new Set<keyof Extremes>();
    for (const { kind, extreme, x, y, depth } of this.#places()) {
      const hit = await this.viewport.pick(x, y);
      if (check !== this.#check) return;
      const { eye } = this.viewport.pose;
      const away = (point: Vec3) => Math.hypot(point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]);
      if (hit !== null && away(hit) < away(extreme.position) - this.tolerance_m(depth)) hidden.add(kind);
    }
    this.#hidden = hidden;
    this.onMarks(this.#marks());
  }
}
