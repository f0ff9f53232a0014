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
    const object = this.#object(decoded.positions, rgba, decoded.indices);
    const { geometry } = object;
    const colours = geometry.getAttribute('color') as BufferAttribute;
    geometry.boundingSphere = new Sphere(new Vector3(...decoded.centre), decoded.radius);
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

  /**
   * An empty tile of each kind. Compiled before the first real one, it spares the main thread the wait for the shader. Returns what
   * removes it again.
   */
  addSpecimens(): () => void {
    const objects = [
      this.#object(new Float32Array(9), new Uint8Array(12), Uint16Array.from([0, 0, 0])),
      this.#object(new Float32Array(3), new Uint8Array(4), null),
    ];
    for (const object of objects) object.frustumCulled = false;
    this.group.add(...objects);
    return () => {
      this.group.remove(...objects);
      for (const { geometry } of objects) geometry.dispose();
    };
  }

  setPointSize(size_px: number): void {
    this.#cloud.size = size_px;
    this.invalidate();
  }

  #object(
    positions: Float32Array<ArrayBuffer>,
    rgba: Uint8Array<ArrayBuffer>,
    indices: Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer> | null,
  ): Mesh | Points {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', new BufferAttribute(rgba, 4, true));
    if (indices !== null) geometry.setIndex(new BufferAttribute(indices, 1));
    const object = indices === null ? new Points(geometry, this.#cloud) : new Mesh(geometry, this.#surface);
    object.matrixAutoUpdate = false;
    return object;
  }

  dispose(): void {
    this.#surface.dispose();
    this.#cloud.dispose();
  }
}
