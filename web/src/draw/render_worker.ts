/// <reference lib="webworker" />
import { PictureRenderer } from './picture_renderer';
import type { RenderReply, RenderRequest } from './render_messages';

declare const self: DedicatedWorkerGlobalScope;

let renderer: PictureRenderer | null = null;

function reply(message: RenderReply, transfer: Transferable[] = []): void {
  self.postMessage(message, transfer);
}

self.onmessage = ({ data: request }: MessageEvent<RenderRequest>) => {
  try {
    if (request.kind === 'start') {
      renderer = new PictureRenderer(request.canvas, reply);
      // For scripts and tests in this worker's console.
      Object.assign(self, { spectra: renderer });
    } else renderer?.handle(request);
  } catch (error) {
    reply({ kind: 'failed', message: error instanceof Error ? error.message : String(error) });
  }
};
