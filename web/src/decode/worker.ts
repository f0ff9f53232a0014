/// <reference lib="webworker" />
import createDecoderModule from 'draco3d/draco_decoder_nodejs.js';
import wasmUrl from 'draco3d/draco_decoder.wasm?url';
import { decodeJob } from './draco';
import type { WorkerReply, WorkerRequest } from './messages';

declare const self: DedicatedWorkerGlobalScope;

async function loadDecoder() {
  const response = await fetch(new URL(wasmUrl, self.location.href));
  if (!response.ok) throw new Error(`the Draco decoder could not be loaded: HTTP ${response.status}`);
  return createDecoderModule({ wasmBinary: await response.arrayBuffer() });
}

const decoder = loadDecoder();

function reply(message: WorkerReply, transfer: Transferable[] = []): void {
  self.postMessage(message, transfer);
}

self.onmessage = async (event: MessageEvent<WorkerRequest>) => {
  const { id, job } = event.data;
  try {
    const result = decodeJob(await decoder, job);
    const transfer: Transferable[] =
      result.kind === 'colours'
        ? [result.rgba.buffer]
        : result.indices === null
          ? [result.positions.buffer]
          : [result.positions.buffer, result.indices.buffer];
    reply({ id, result }, transfer);
  } catch (error) {
    reply({ id, error: error instanceof Error ? error.message : String(error) });
  }
};
