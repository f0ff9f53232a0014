/** How far from what is highlighted the light line ends, and the dark one around it, CSS pixels. */
const LINES = [1, 2] as const;

const VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
uniform sampler2D picture;
uniform vec2 lines;
out vec4 colour;
// How much of a pixel, 0 to 1, shows what is highlighted.
float shareAt(ivec2 place) {
  return 1.0 - texelFetch(picture, clamp(place, ivec2(0), textureSize(picture, 0) - 1), 0).a;
}
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec4 here = texelFetch(picture, place, 0);
  float light = 0.0;
  float dark = 0.0;
  for (float ring = 1.0; ring <= lines.y; ring += 1.0) {
    int places = ring < 1.5 ? 8 : 12;
    for (int i = 0; i < places; i += 1) {
      float angle = float(i) * 6.283185 / float(places);
      float share = shareAt(place + ivec2(round(ring * vec2(cos(angle), sin(angle)))));
      dark = max(dark, share);
      if (ring <= lines.x) light = max(light, share);
    }
  }
  // here.a: how much of this pixel is not highlighted, and may be covered.
  colour = vec4(mix(mix(here.rgb, vec3(0.0), dark * here.a), vec3(1.0), light * here.a), 1.0);
}`;

/**
 * Draws a picture with two lines around what is highlighted, a light and a dark one, so that they are seen on any colours, in grey and on
 * paper. What is highlighted keeps its colours. The picture's alpha is 1 minus how much of a pixel is highlighted.
 */
export class Outline {
  readonly #program: WebGLProgram;
  readonly #framebuffer: WebGLFramebuffer;
  readonly #texture: WebGLTexture;
  readonly #lines: WebGLUniformLocation | null;
  #size: [number, number] = [0, 0];

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#program = gl.createProgram();
    for (const [type, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ] as const) {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.#program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(this.#program);
    this.#lines = gl.getUniformLocation(this.#program, 'lines');
    this.#texture = gl.createTexture();
    this.#framebuffer = gl.createFramebuffer();
  }

  /** Draws what `framebuffer` holds on the canvas; the renderer's state is lost. `pixel_ratio`: pixels of the picture per CSS pixel. */
  draw(framebuffer: WebGLFramebuffer, width: number, height: number, pixel_ratio: number): void {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    if (this.#size[0] !== width || this.#size[1] !== height) {
      this.#size = [width, height];
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.#texture, 0);
    }
    // Of several samples a pixel this makes one, as far as the highlighted share goes, too.
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.#framebuffer);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    for (const test of [gl.DEPTH_TEST, gl.CULL_FACE, gl.BLEND, gl.SCISSOR_TEST]) gl.disable(test);
    gl.useProgram(this.#program);
    const [light, dark] = LINES;
    gl.uniform2f(this.#lines, Math.max(1, Math.round(light * pixel_ratio)), Math.max(2, Math.round(dark * pixel_ratio)));
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  dispose(): void {
    this.gl.deleteProgram(this.#program);
    this.gl.deleteFramebuffer(this.#framebuffer);
    this.gl.deleteTexture(this.#texture);
  }
}
