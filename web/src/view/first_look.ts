import type { GeometrySummary } from '../decode/messages';
import type { CameraPose, Scene, Vec3 } from '../protocol/messages';
import {
  type Bounds,
  corners,
  fittedView,
  type Insets,
  meanNormal,
  samplePoints,
  type UpAxis,
  type View,
  viewDirection,
  withoutStrays,
} from './first_view';
import type { UpChoices } from './up_choices';

/** The part of the viewport that is needed to look at a scene. */
export interface Looking {
  readonly pose: CameraPose;
  readonly aspect: number;
  /** Pictures lose nothing while the camera moves. */
  readonly movesInFull: boolean;
  setUpAxis(up: UpAxis): void;
  setView(view: View, animated: boolean): void;
  setReach(nearest: number, farthest: number): void;
}

/** Nearest approach, as a share of the scene's size: 4 mm in a map of 4 km. */
const NEAREST_SHARE = 1e-6;
const FARTHEST_RADII = 20;

/** A live map is followed when it would be looked at from a place that is this share of the distance away. */
const FOLLOWED_SHARE = 0.02;

/**
 * Where the scene is looked at from until the user takes the camera: decided when the first tile is there, however coarse, and then
 * left alone, but for the size of the picture. A live map stays in the picture as a whole while it grows, seen from the same side.
 */
export class FirstLook {
  #scene: Scene | null = null;
  #up: UpAxis = 'y';
  #userMoved = false;
  /** What the first tile said; null until it has come. */
  #decided: { points: Vec3[]; facing: Vec3 } | null = null;
  /** What was last looked from. */
  #view: View | null = null;
  #insets: Insets = { left: 0, right: 0, top: 0, bottom: 0 };

  constructor(
    private readonly viewport: Looking,
    private readonly choices: UpChoices,
    private readonly tiles: () => Iterable<{ level: number; geometry: GeometrySummary }>,
    private readonly onUp: (up: UpAxis) => void,
  ) {}

  /** Nothing to look at any more, another scene, or more of the one that is looked at. */
  sceneIs(scene: Scene | null): void {
    const before = this.#scene;
    this.#scene = scene;
    if (scene === null) return;
    this.#updateReach();
    const isSame = before !== null && before.name === scene.name && before.up === scene.up;
    if (isSame && (this.#userMoved || scene.live === true || isLike(before, scene))) return;
    this.#decided = null;
    this.#userMoved = false;
    this.#setUp(this.choices.get(scene.name, scene.bounds) ?? scene.up);
    this.#look(false);
  }

  /** Tiles have come. */
  pictureChanged(): void {
    if (this.#scene === null) return;
    if (this.#decided !== null) {
      if (this.#scene.live === true && !this.#userMoved) this.#follow();
      return;
    }
    this.#decide();
    if (this.#decided !== null && !this.#userMoved) this.#look(false);
  }

  /** The user moved the camera: from now on it is not moved for them. */
  userMoved(): void {
    this.#userMoved = true;
  }

  /** The picture has another size, or another part of it is free. */
  pictureIs(insets: Insets | null): void {
    if (insets !== null) this.#insets = insets;
    if (!this.#userMoved && this.#scene !== null) this.#look(false);
  }

  /** The user says which way is up; it is remembered unless it is what the server says. */
  chooseUp(up: UpAxis): void {
    this.#setUp(up);
    const scene = this.#scene;
    if (scene === null) return;
    this.choices.set(scene.name, scene.bounds, up === scene.up ? null : up);
    this.reset();
  }

  /** Has the scene without its strays in the picture, from where the camera looks. */
  fit(): void {
    const scene = this.#scene;
    if (scene === null) return;
    this.#userMoved = true;
    const { eye, target } = this.viewport.pose;
    const points = withoutStrays(samplePoints(this.#geometries()), scene.core_bounds ?? boxOf(this.#decided?.points ?? []));
    this.#fit(points, [eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]], true);
  }

  /** Back to the first view. */
  reset(): void {
    this.#userMoved = false;
    // By now it may have quite another face.
    if (this.#scene?.live === true) this.#decide();
    this.#look(true);
  }

  #decide(): void {
    // Whatever finer ones have come with it: what is seen first must not depend on how fast they are.
    const geometries = this.#coarsest();
    if (geometries.length === 0) return;
    this.#decided = { points: this.#pointsOf(geometries), facing: meanNormal(geometries) };
  }

  #follow(): void {
    // The coarsest may be those of before: they do not come again as long as finer ones are drawn in their place.
    const points = this.#pointsOf(this.#geometries());
    if (this.#decided === null || this.#view === null || points.length === 0) return;
    const { facing } = this.#decided;
    const [before, next] = [this.#view, this.#fitted(points, viewDirection(facing, this.#up))];
    const step = FOLLOWED_SHARE * between(next.eye, next.target);
    if (between(before.eye, next.eye) <= step && between(before.target, next.target) <= step) return;
    this.#decided = { points, facing };
    // Where moving costs detail, the picture would be coarse again and again for as long as the map grows.
    this.#look(this.viewport.movesInFull);
  }

  #pointsOf(geometries: GeometrySummary[]): Vec3[] {
    return withoutStrays(samplePoints(geometries), this.#scene?.core_bounds ?? null);
  }

  #setUp(up: UpAxis): void {
    this.#up = up;
    this.viewport.setUpAxis(up);
    this.onUp(up);
  }

  #look(animated: boolean): void {
    const scene = this.#scene;
    if (scene === null) return;
    const { points, facing } = this.#decided ?? { points: corners(scene.core_bounds ?? scene.bounds), facing: [0, 0, 0] };
    this.#fit(points, viewDirection(facing as Vec3, this.#up), animated);
  }

  #fit(points: readonly Vec3[], direction: Vec3, animated: boolean): void {
    this.#view = this.#fitted(points, direction);
    this.viewport.setView(this.#view, animated);
  }

  #fitted(points: readonly Vec3[], direction: Vec3): View {
    const { fov_y_deg } = this.viewport.pose;
    const fov = (fov_y_deg * Math.PI) / 180;
    return fittedView(points, direction, this.#up, fov, this.viewport.aspect, this.#insets);
  }

  #geometries(): GeometrySummary[] {
    return [...this.tiles()].map(({ geometry }) => geometry);
  }

  #coarsest(): GeometrySummary[] {
    const tiles = [...this.tiles()];
    const coarsest = Math.min(...tiles.map(({ level }) => level));
    return tiles.filter(({ level }) => level === coarsest).map(({ geometry }) => geometry);
  }

  /** Far enough away to see everything, strays too; near enough to see the finest detail that there is. */
  #updateReach(): void {
    if (this.#scene === null) return;
    const { bounds, core_bounds } = this.#scene;
    this.viewport.setReach(sizeOf(core_bounds ?? bounds) * NEAREST_SHARE, (sizeOf(bounds) / 2) * FARTHEST_RADII);
  }
}

function boxOf(points: readonly Vec3[]): Bounds | null {
  if (points.length === 0) return null;
  const ends = (pick: (...values: number[]) => number): Vec3 =>
    [0, 1, 2].map((axis) => points.reduce((end, point) => pick(end, point[axis]!), points[0]![axis]!)) as Vec3;
  return { min: ends(Math.min), max: ends(Math.max) };
}

function between(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

function sizeOf({ min, max }: Bounds): number {
  return Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) || 1;
}

/** A scene that grows bit by bit stays where it is looked at. */
function isLike({ bounds: a }: Scene, { bounds: b }: Scene): boolean {
  const overlaps = [0, 1, 2].every((axis) => a.min[axis]! <= b.max[axis]! && b.min[axis]! <= a.max[axis]!);
  const diagonal = ({ min, max }: Bounds) => Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
  return overlaps && Math.max(diagonal(a), diagonal(b)) <= 2 * Math.min(diagonal(a), diagonal(b));
}
