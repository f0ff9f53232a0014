/**
 * The part of three.js that the page itself uses. Taken file by file: the package's one big module would bring along the renderer,
 * which is loaded where it draws.
 */
export { PerspectiveCamera } from 'three/src/cameras/PerspectiveCamera.js';
export { Raycaster } from 'three/src/core/Raycaster.js';
export { Box3 } from 'three/src/math/Box3.js';
export { MathUtils } from 'three/src/math/MathUtils.js';
export { Matrix4 } from 'three/src/math/Matrix4.js';
export { Quaternion } from 'three/src/math/Quaternion.js';
export { Sphere } from 'three/src/math/Sphere.js';
export { Spherical } from 'three/src/math/Spherical.js';
export { Vector2 } from 'three/src/math/Vector2.js';
export { Vector3 } from 'three/src/math/Vector3.js';
export { Vector4 } from 'three/src/math/Vector4.js';
