import { describe, expect, it } from 'vitest';
import { PerspectiveCamera, Vector3 } from './three_math';
import type { Vec3 } from '../protocol/messages';
import { directionInScene, distanceOf, lookAt, lookOf, toView, worldFromCamera } from './look';

function expectNear(actual: readonly number[], expected: readonly number[]): void {
  expect(actual).toHaveLength(expected.length);
  actual.forEach((value, i) => expect(value).toBeCloseTo(expected[i]!, 9));
}

describe('a look', () => {
  const eye: Vec3 = [3, -2, 7];
  const target: Vec3 = [1, 4, -2];

  it.each([[[0, 1, 0] as Vec3], [[0, 0, 1] as Vec3], [[-1, 0, 0] as Vec3]])('is that of a camera with %j upwards', (up) => {
    const camera = new PerspectiveCamera();
    camera.up.set(...up);
    camera.position.set(...eye);
    camera.lookAt(...target);
    camera.updateMatrixWorld();
    const look = lookAt(eye, target, up);
    expectNear(worldFromCamera(look), camera.matrixWorld.toArray());
    const point: Vec3 = [0.5, -0.25, 2];
    expectNear(toView(look, point), new Vector3(...point).applyMatrix4(camera.matrixWorldInverse).toArray());
  });

  it('sees what it aims at straight ahead', () => {
    const look = lookAt(eye, target, [0, 1, 0]);
    expectNear(toView(look, target), [0, 0, -distanceOf(look)]);
    expectNear(
      directionInScene(look, [0, 0, -distanceOf(look)]),
      target.map((value, axis) => value - eye[axis]!),
    );
  });

  it('is told from its matrix', () => {
    const look = lookAt(eye, target, [0, 1, 0]);
    expect(lookOf(worldFromCamera(look), target)).toEqual(look);
  });

  it.each([[[0, 1, 0] as Vec3], [[1, 0, 0] as Vec3], [[0, 0, -1] as Vec3]])(
    'straight along %j still has axes that are square',
    (up) => {
      const { right, up: upwards, back } = lookAt(up, [0, 0, 0], up);
      expectNear(back, up);
      const square = [right, upwards, back].map((a) =>
        [right, upwards, back].map((b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2]),
      );
      expectNear(square.flat(), [1, 0, 0, 0, 1, 0, 0, 0, 1]);
    },
  );

  it('from the place it aims at looks somewhere', () => {
    expect(
      Object.values(lookAt([1, 1, 1], [1, 1, 1], [0, 1, 0]))
        .flat()
        .every(Number.isFinite),
    ).toBe(true);
  });
});
