import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Group,
  Mesh,
  MeshBasicMaterial,
  Points,
  PointsMaterial,
  Sphere,
  Vector3,
} from 'three';
import type { DecodedGeometry } from '../decode/messages';
import type { Drawable } from './tile_set';

/** Owns the materials that all tiles share and the group they stand in. */
export class TileDrawing {
  readonly group = new Group();
  readonly #surface = new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, toneMapped: false, fog: false });
  readonly #cloud = new PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false, toneMapped: false, fog: false });

  constructor(private readonly invalidate: () => void) {
    this.group.matrixAutoUpdate = false;
  }

  /** Makes one tile, hidden until it is selected. */
  create(decoded: DecodedGeometry, rgba: Uint8Array<ArrayBuffer>): Drawable {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(decoded.positions, 3));
    const colours = new BufferAttribute(rgba, 4, true);
    geometry.setAttribute('color', colours);
    if (decoded.indices !== null) geometry.setIndex(new BufferAttribute(decoded.indices, 1));
    geometry.boundingSphere = new Sphere(new Vector3(...decoded.centre), decoded.radius);
    const object = decoded.indices === null ? new Points(geometry, this.#cloud) : new Mesh(geometry, this.#surface);
    object.matrixAutoUpdate = false;
    object.visible = false;
    this.group.add(object);
    this.invalidate();
    return {
      setColours: (next) => {
        colours.array = next;
        colours.needsUpdate = true;
        this.invalidate();
      },
      setVisible: (visible) => {
        object.visible = visible;
      },
      dispose: () => {
        this.group.remove(object);
        geometry.dispose();
        this.invalidate();
      },
    };
  }

  setPointSize(size_px: number): void {
    this.#cloud.size = size_px;
    this.invalidate();
  }

  dispose(): void {
    this.#surface.dispose();
    this.#cloud.dispose();
  }
}
