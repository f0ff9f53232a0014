import { afterAll, beforeAll, describe, expect, it, vi } from 'vitest';
import type { Vec3 } from '../protocol/messages';
import { AimedControls } from './aimed_controls';
import { PerspectiveCamera, Vector3 } from './three_math';

function controls(): AimedControls {
  const created = new AimedControls(new PerspectiveCamera(45, 1, 0.1, 100));
  created.minDistance = 0.01;
  created.maxDistance = 1000;
  created.smoothTime = 0.1;
  void created.setLookAt(10, 5, 0, 0, 0, 0, false);
  created.update(0.016);
  return created;
}
const eye = (of: AimedControls, atEnd: boolean): Vec3 => of.getPosition(new Vector3(), atEnd).toArray();
const target = (of: AimedControls): Vec3 => of.getTarget(new Vector3(), true).toArray();

function expectNear(actual: Vec3, expected: Vec3): void {
  actual.forEach((value, axis) => expect(value).toBeCloseTo(expected[axis]!, 9));
}

// The controls measure the element that they are given; here there is none.
beforeAll(() => void vi.stubGlobal('DOMRect', Object));
afterAll(() => void vi.unstubAllGlobals());

describe('AimedControls', () => {
  it('puts the target at the depth of a point and leaves the camera where it is', () => {
    const aimed = controls();
    aimed.aimAt([4, 2, 0]);
    expectNear(eye(aimed, true), [10, 5, 0]);
    expectNear(target(aimed), [4, 2, 0]);
    expect(aimed.distance).toBeCloseTo(Math.hypot(6, 3), 9);
    // Beside the line of sight: the depth counts.
    aimed.aimAt([4 + 3, 2 - 6, 9]);
    expectNear(target(aimed), [4, 2, 0]);
  });

  it('leaves a camera on its way', () => {
    const aimed = controls();
    const same = controls();
    for (const moving of [aimed, same]) {
      void moving.rotate(0.5, -0.1, true);
      void moving.dolly(3, true);
      moving.update(0.016);
    }
    aimed.aimAt([2, 1, 0]);
    expectNear(eye(aimed, false), eye(same, false));
    expectNear(eye(aimed, true), eye(same, true));
  });

  it('does not aim at what is behind the camera or out of reach', () => {
    const aimed = controls();
    for (const point of [
      [20, 10, 0],
      [-9000, -4500, 0],
      [10 - 1e-4, 5, 0],
    ] as Vec3[]) {
      aimed.aimAt(point);
      expectNear(target(aimed), [0, 0, 0]);
    }
  });
});
