/// <reference lib="webworker" />
import createDecoderModule from 'draco3d/draco_decoder_nodejs.js';
import wasmUrl from 'draco3d/draco_decoder.wasm?url';
import { decodeJob } from './draco';
import type { DecodeResult, WorkerReply, WorkerRequest } from './messages';

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

function buffersOf(result: DecodeResult): Transferable[] {
  switch (result.kind) {
    case 'geometry':
      return [result.positions.buffer, ...(result.indices === null ? [] : [result.indices.buffer])];
    case 'colours':
      return [result.rgba.buffer];
    case 'visible':
      return [result.rgb.buffer];
    case 'temperature':
    case 'sigma':
      return [result.codes.buffer];
  }
}

self.onmessage = async (event: MessageEvent<WorkerRequest>) => {
  const { id, job } = event.data;
  try {
    const result = decodeJob(await decoder, job);
    reply({ id, result }, buffersOf(result));
  } catch (error) {
    reply({ id, error: error instanceof Error ? error.message : String(error) });
  }
};
