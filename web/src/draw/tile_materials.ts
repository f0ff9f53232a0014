import { DoubleSide, GLSL3, RawShaderMaterial, Vector2, Vector3 } from 'three';
import type { Vec3 } from '../protocol/messages';
import type { DepthRange } from './depth_range';

const VERTEX = `
precision highp float;
uniform mat4 projectionMatrix;
uniform mat4 viewMatrix;
uniform vec3 eye;
uniform vec3 eyeRest;
in vec3 position;
in vec4 color;
out vec4 vertexColour;
#ifdef WIDE
out float depth;
#endif
#ifdef POINTS
uniform float pointSize;
uniform float pixelsPerTangent;
uniform vec2 pointPixels;
out float pointDiameter;
#endif
void main() {
  vertexColour = color;
  // From the eye first: close to it the difference is exact, far from the origin, too. A product with large numbers is not.
  gl_Position = projectionMatrix * vec4(mat3(viewMatrix) * ((position - eye) - eyeRest), 1.0);
#ifdef WIDE
  depth = gl_Position.w;
#endif
#ifdef POINTS
  gl_PointSize = clamp(pointSize * pixelsPerTangent / gl_Position.w, pointPixels.x, pointPixels.y);
  pointDiameter = gl_PointSize;
#endif
}`;

const FRAGMENT = `
precision highp float;
in vec4 vertexColour;
uniform bool isOutlined;
out vec4 colour;
#ifdef WIDE
in float depth;
uniform vec2 depthScale;
#endif
#ifdef POINTS
in float pointDiameter;
#endif
void main() {
#ifdef POINTS
  if (pointDiameter > 4.0 && distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
#endif
  colour = vec4(vertexColour.rgb, 1.0);
  // What is highlighted has no alpha. Between the two the border is where both have half a share, one pixel wide.
  if (isOutlined) colour.a = clamp((vertexColour.a - 0.5) / max(fwidth(vertexColour.a), 1e-5) + 0.5, 0.0, 1.0);
#ifdef WIDE
  gl_FragDepth = log2(depth * depthScale.x) * depthScale.y;
#endif
}`;

/** Least and largest diameter of a point on the screen, CSS pixels; a few places alone would not be found at the least. */
const POINT_PIXELS = [2, 256] as const;
const LONE_POINT_PIXELS = 7;
const FEW_POINTS = 50;

/**
 * The materials of surfaces and point clouds: unlit vertex colours. Where the depths of a picture are so wide apart that an ordinary
 * depth buffer cannot tell surfaces apart, depth is kept as its logarithm, which is as exact near as far and costs a little more.
 */
export class TileMaterials {
  readonly #uniforms = {
    eye: { value: new Vector3() },
    eyeRest: { value: new Vector3() },
    depthScale: { value: new Vector2() },
    pointSize: { value: 0 },
    pixelsPerTangent: { value: 1 },
    pointPixels: { value: new Vector2() },
    isOutlined: { value: false },
  };
  readonly #surface = { plain: this.#material({}), wide: this.#material({ WIDE: '' }) };
  readonly #cloud = { plain: this.#material({ POINTS: '' }), wide: this.#material({ POINTS: '', WIDE: '' }) };
  #isWide = false;

  get all(): RawShaderMaterial[] {
    return [...Object.values(this.#surface), ...Object.values(this.#cloud)];
  }

  get surface(): RawShaderMaterial {
    return this.#isWide ? this.#surface.wide : this.#surface.plain;
  }

  get cloud(): RawShaderMaterial {
    return this.#isWide ? this.#cloud.wide : this.#cloud.plain;
  }

  /** `pixelsPerTangent`: width on the drawing buffer of something of width 1 at distance 1. */
  lookFrom(eye: Vec3, { near, far, isWide }: DepthRange, pixelsPerTangent: number): void {
    const { eye: rounded, eyeRest, depthScale } = this.#uniforms;
    rounded.value.set(...(eye.map(Math.fround) as Vec3));
    eyeRest.value.set(eye[0] - rounded.value.x, eye[1] - rounded.value.y, eye[2] - rounded.value.z);
    depthScale.value.set(1 / near, 1 / Math.log2(far / near));
    this.#uniforms.pixelsPerTangent.value = pixelsPerTangent;
    this.#isWide = isWide;
  }

  /** The points drawn next have this diameter in metres; `pixel_ratio`: pixels of the drawing buffer per CSS pixel. */
  setPoints(diameter: number, count: number, pixel_ratio: number): void {
    const [least, most] = POINT_PIXELS;
    this.#uniforms.pointSize.value = diameter;
    const isLone = count < FEW_POINTS || diameter === 0;
    this.#uniforms.pointPixels.value.set((isLone ? LONE_POINT_PIXELS : least) * pixel_ratio, most * pixel_ratio);
    this.cloud.uniformsNeedUpdate = true;
  }

  /** The alpha of a picture tells what is highlighted (see Outline) rather than nothing. */
  setOutlined(isOutlined: boolean): void {
    this.#uniforms.isOutlined.value = isOutlined;
  }

  dispose(): void {
    for (const material of this.all) material.dispose();
  }

  #material(defines: Record<string, string>): RawShaderMaterial {
    return new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: this.#uniforms,
      defines,
      side: DoubleSide,
      toneMapped: false,
    });
  }
}
