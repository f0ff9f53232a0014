/** The messages of docs/protocol.md: their types and strict readers. Field names are the wire's. */

import {
  array,
  boolean,
  count,
  DecodeError,
  type Decoder,
  dictionary,
  nullable,
  number,
  object,
  oneOf,
  optional,
  pair,
  record,
  string,
  triple,
  unknown,
} from './decode';

export type Vec3 = [number, number, number];

export const temperatureSummary = object({
  min: nullable(number),
  max: nullable(number),
  mean: nullable(number),
  sigma: nullable(number),
  missing_count: count,
});

export const scene = object({
  name: string,
  revision: count,
  vertex_count: count,
  triangle_count: count,
  point_cloud: boolean,
  origin: triple(number),
  bounds: object({ min: triple(number), max: triple(number) }),
  temperature: temperatureSummary,
  tile_count: count,
  levels: count,
});
export type Scene = ReturnType<typeof scene>;

/** The value of a method's parameter; null = automatic. */
export type ParameterValue = number | boolean | string | null;

const parameterValue: Decoder<ParameterValue> = (value, path) => {
  if (value === null || typeof value === 'boolean' || typeof value === 'string') return value;
  return number(value, path);
};

export const parameter = object({
  name: string,
  label: string,
  help: string,
  kind: string,
  default: parameterValue,
  min: optional(number),
  max: optional(number),
  exclusive_min: optional(number),
  step: optional(number),
  unit: optional(string),
  options: optional(array(string)),
});
export type Parameter = ReturnType<typeof parameter>;

export const method = object({
  id: string,
  label: string,
  summary: string,
  needs_temperature: optional(boolean),
  uses_palette: optional(boolean),
  params: array(parameter),
});
export type Method = ReturnType<typeof method>;

export const palette = object({
  id: string,
  label: string,
  fusion_safe: boolean,
  colours: array(triple(number)),
});
export type Palette = ReturnType<typeof palette>;

export const range = object({ mode: oneOf('auto', 'manual'), min: nullable(number), max: nullable(number) });
export type Range = ReturnType<typeof range>;

export const fusion = object({
  method: string,
  params: dictionary(parameterValue),
  params_in_force: optional(dictionary(parameterValue)),
  palette: string,
  range,
  missing: string,
});
export type Fusion = ReturnType<typeof fusion>;

/** A partial change for fusion.set; what is absent stays, parameters merge. */
export interface FusionChange {
  method?: string;
  params?: Record<string, ParameterValue>;
  palette?: string;
  range?: { mode: 'auto' } | { mode: 'manual'; min: number; max: number };
  missing?: string;
}

export const quality = object({
  mode: oneOf('auto', 'manual'),
  position_step_mm: number,
  colour_bits: count,
  pixel_error: optional(number),
  encoder_speed: optional(count),
  latency_target_ms: optional(nullable(number)),
});
export type Quality = ReturnType<typeof quality>;
export type QualityChange = Partial<Quality>;

export const hello = object({
  protocol: oneOf('spectra.v1'),
  server: object({ name: string, version: string }),
  session_id: string,
  role: oneOf('operator', 'viewer'),
  capabilities: array(string),
  limits: object({
    max_message_bytes: optional(count),
    max_depth: optional(count),
    max_requests_per_s: optional(number),
  }),
  scene: nullable(scene),
  methods: array(method),
  palettes: array(palette),
  fusion,
  quality,
});
export type Hello = ReturnType<typeof hello>;

export const fusionState = object({ generation: count, fusion });
export type FusionState = ReturnType<typeof fusionState>;

export const qualityState = object({ quality });

export const histogram = object({
  edges: array(number),
  counts: array(number),
  mean: nullable(number),
  sigma: nullable(number),
  highlighted: array(pair(number)),
});
export type Histogram = ReturnType<typeof histogram>;

export const probe = object({
  vertex_index: count,
  position: triple(number),
  temperature: nullable(number),
  visible: triple(number),
  fused: triple(number),
  distance: number,
});
export type Probe = ReturnType<typeof probe>;

const extreme = object({ position: triple(number), temperature: number });
export type Extreme = ReturnType<typeof extreme>;
export const extremes = object({ hottest: nullable(extreme), coldest: nullable(extreme) });
export type Extremes = ReturnType<typeof extremes>;

export const sceneChanged = object({ scene: nullable(scene) });

export const streamComplete = object({ generation: count, scene_revision: count, tiles: count, vertices: count });
export type StreamComplete = ReturnType<typeof streamComplete>;

export const streamStats = object({
  round_trip_ms: optional(nullable(number)),
  throughput_bytes_per_s: optional(nullable(number)),
  queued_bytes: optional(number),
  skipped_frames: optional(count),
  viewers: optional(count),
  accuracy: optional(
    object({
      position_mm: optional(nullable(number)),
      colour_levels: optional(nullable(number)),
      pixel_error: optional(nullable(number)),
    }),
  ),
});
export type StreamStats = ReturnType<typeof streamStats>;

export const status = object({
  id: string,
  level: optional(oneOf('info', 'warning', 'error')),
  message: nullable(string),
});
export type Status = ReturnType<typeof status>;

export const rpcError = object({
  code: number,
  message: string,
  data: optional(nullable(object({ field: optional(nullable(string)), reason: optional(string), limits: optional(unknown) }))),
});
export type RpcErrorBody = ReturnType<typeof rpcError>;

/** What the server sends as text: an answer to a request of ours, or a notification. */
export type ServerMessage =
  | { type: 'result'; id: number; result: unknown }
  | { type: 'error'; id: number | null; error: RpcErrorBody }
  | { type: 'notification'; method: string; params: unknown };

/** Reads a text message; throws DecodeError or SyntaxError. */
export function decodeServerMessage(text: string): ServerMessage {
  const message = record(JSON.parse(text) as unknown, '');
  if (message['jsonrpc'] !== '2.0') throw new DecodeError('jsonrpc', '"2.0"', message['jsonrpc']);
  if (typeof message['method'] === 'string') {
    return { type: 'notification', method: message['method'], params: message['params'] ?? {} };
  }
  if (message['error'] !== undefined) {
    return { type: 'error', id: nullable(count)(message['id'] ?? null, 'id'), error: rpcError(message['error'], 'error') };
  }
  if (!('result' in message)) throw new DecodeError('', 'a result, an error or a method', text);
  return { type: 'result', id: count(message['id'], 'id'), result: message['result'] };
}
