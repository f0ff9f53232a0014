import type { RenderReply, RenderRequest } from './render_messages';

/** The way to the side that draws. */
export interface RenderPort {
  send(request: Exclude<RenderRequest, { kind: 'start' }>, transfer: Transferable[]): void;
  dispose(): void;
}

/** Draws in a worker of its own. */
export function startRenderWorker(worker: Worker, canvas: HTMLCanvasElement, onReply: (reply: RenderReply) => void): RenderPort {
  worker.onmessage = ({ data }: MessageEvent<RenderReply>) => onReply(data);
  worker.onerror = (event) => onReply({ kind: 'failed', message: event.message || 'the drawing worker failed' });
  const offscreen = canvas.transferControlToOffscreen();
  worker.postMessage({ kind: 'start', canvas: offscreen } satisfies RenderRequest, [offscreen]);
  return {
    send: (request, transfer) => worker.postMessage(request, transfer),
    dispose: () => worker.terminate(),
  };
}

/** Draws in the page, for browsers whose workers cannot. */
export function startRenderingHere(canvas: HTMLCanvasElement, onReply: (reply: RenderReply) => void): RenderPort {
  let isOpen = true;
  const renderer = import('./picture_renderer').then(({ PictureRenderer }) => new PictureRenderer(canvas, onReply));
  const failed = (error: unknown) => {
    if (isOpen) onReply({ kind: 'failed', message: error instanceof Error ? error.message : String(error) });
  };
  return {
    send: (request) => {
      renderer.then((created) => created.handle(request)).catch(failed);
    },
    dispose: () => {
      isOpen = false;
      renderer.then((created) => created.dispose()).catch(() => undefined);
    },
  };
}
