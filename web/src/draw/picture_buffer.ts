import { WebGLRenderTarget, type WebGLRenderer } from 'three';
import type { Outline } from './outline';

interface WithFramebuffers {
  setRenderTargetFramebuffer: (target: WebGLRenderTarget, framebuffer: WebGLFramebuffer) => void;
}

/**
 * Where a picture comes into being, out of sight: it reaches the canvas when it is complete, however many tasks that takes. With more
 * than one sample a pixel its edges are smooth.
 */
export class PictureBuffer {
  readonly target: WebGLRenderTarget;
  readonly #framebuffer: WebGLFramebuffer;
  readonly #parts: WebGLRenderbuffer[] = [];

  constructor(
    private readonly renderer: WebGLRenderer,
    readonly width: number,
    readonly height: number,
    readonly samples: number,
  ) {
    const gl = this.#gl;
    this.#framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    for (const [format, attachment] of [
      [gl.RGBA8, gl.COLOR_ATTACHMENT0],
      [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT],
    ] as const) {
      const part = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, part);
      const most = Math.min(samples, gl.getParameter(gl.MAX_SAMPLES) as number);
      if (samples > 1) gl.renderbufferStorageMultisample(gl.RENDERBUFFER, most, format, width, height);
      else gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, part);
      this.#parts.push(part);
    }
    gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    // The renderer remembers what is bound.
    renderer.resetState();
    this.target = new WebGLRenderTarget(width, height, { depthBuffer: true });
    // The renderer's own targets smooth their edges anew after every part of a picture. Its types do not know the method.
    (renderer as WebGLRenderer & WithFramebuffers).setRenderTargetFramebuffer(this.target, this.#framebuffer);
  }

  get #gl(): WebGL2RenderingContext {
    return this.renderer.getContext() as WebGL2RenderingContext;
  }

  /** Copies the picture to the canvas, which has the same size, or draws it there with an outline. */
  present(outline: Outline | null, pixel_ratio: number): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    // A copy alone does not tell every browser that the canvas has changed.
    gl.clear(gl.COLOR_BUFFER_BIT);
    const { width, height } = this;
    if (outline !== null) outline.draw(this.#framebuffer, width, height, pixel_ratio);
    else {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#framebuffer);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    }
    this.renderer.resetState();
  }

  dispose(): void {
    const gl = this.#gl;
    gl.deleteFramebuffer(this.#framebuffer);
    for (const part of this.#parts) gl.deleteRenderbuffer(part);
  }
}
