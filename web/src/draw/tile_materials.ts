import { DoubleSide, GLSL3, RawShaderMaterial, Vector2, Vector3 } from 'three';
import type { Vec3 } from '../protocol/messages';
import type { DepthRange } from './depth_range';
import { sigmaStep, UNKNOWN_SIGMA } from './sigma_steps';

const VERTEX = `
precision highp float;
uniform mat4 projectionMatrix;
uniform mat4 viewMatrix;
uniform vec3 eye;
uniform vec3 eyeRest;
in vec3 position;
in vec4 color;
in float sigma;
out float unsure;
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
  unsure = sigma;
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
in float unsure;
uniform bool isOutlined;
uniform vec2 hatch;
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
  if (unsure > hatch.x) {
    float line = abs(mod((gl_FragCoord.x + gl_FragCoord.y) / hatch.y, 8.0) - 4.0);
    float end = step(dot(colour.rgb, vec3(0.299, 0.587, 0.114)), 0.5);
    colour.rgb = mix(colour.rgb, vec3(end), 0.6 * clamp(1.5 - line, 0.0, 1.0));
  }
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
    /** Beyond which step of sigma (of 1, more than which is none), and the pixels of the drawing buffer per CSS pixel. */
    hatch: { value: new Vector2(2, 1) },
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
  lookFrom(eye: Vec3, { near, far, isWide }: DepthRange, pixelsPerTangent: number, pixel_ratio: number): void {
    const { eye: rounded, eyeRest, depthScale } = this.#uniforms;
    rounded.value.set(...(eye.map(Math.fround) as Vec3));
    eyeRest.value.set(eye[0] - rounded.value.x, eye[1] - rounded.value.y, eye[2] - rounded.value.z);
    depthScale.value.set(1 / near, 1 / Math.log2(far / near));
    this.#uniforms.pixelsPerTangent.value = pixelsPerTangent;
    this.#uniforms.hatch.value.y = pixel_ratio;
    this.#isWide = isWide;
  }

  /** Lines, dark on what is bright and bright on what is dark, where a temperature is less sure than that. */
  setHatch(kelvin: number | null): void {
    this.#uniforms.hatch.value.x = kelvin === null ? 2 : (sigmaStep(kelvin) + 0.5) / UNKNOWN_SIGMA; // between steps
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
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: this.#uniforms,
      defines,
      side: DoubleSide,
      toneMapped: false,
    });
    // Of a tile whose sigma has not come nobody knows here.
    material.defaultAttributeValues = { sigma: [1] };
    return material;
  }
}
