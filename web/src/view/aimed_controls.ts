import CameraControls from 'camera-controls';
import type { Vec3 } from '../protocol/messages';
import { Box3, MathUtils, Matrix4, Quaternion, Raycaster, Sphere, Spherical, Vector2, Vector3, Vector4 } from './three_math';

CameraControls.install({
  THREE: { Box3, MathUtils, Matrix4, Quaternion, Raycaster, Sphere, Spherical, Vector2, Vector3, Vector4 },
});

/** The camera's controls, whose target can be put on what is seen without moving the camera. */
export class AimedControls extends CameraControls {
  /**
   * Moves the target, which the camera turns about and comes nearer to, along the line of sight to the depth of `point`. The camera
   * stays where it is, and on its way when it is moving. Does nothing for a point behind the camera or out of the controls' reach.
   */
  aimAt(point: Vec3): void {
    const backward = this.#backward(this._sphericalEnd);
    const eye = this._targetEnd.clone().addScaledVector(backward, this._sphericalEnd.radius);
    const depth = eye.sub(new Vector3(...point)).dot(backward);
    if (depth < this.minDistance || depth > this.maxDistance) return;
    const shift = depth - this._sphericalEnd.radius;
    if (this._spherical.radius + shift <= 0) return;
    this._target.addScaledVector(this.#backward(this._spherical), -shift);
    this._targetEnd.addScaledVector(backward, -shift);
    for (const place of [this._spherical, this._sphericalEnd]) place.radius += shift;
    this._lastDistance += shift;
  }

  /** From the target to the camera, of length 1. */
  #backward({ theta, phi }: { theta: number; phi: number }) {
    return new Vector3().setFromSphericalCoords(1, phi, theta).applyQuaternion(this._yAxisUpSpaceInverse);
  }
}
