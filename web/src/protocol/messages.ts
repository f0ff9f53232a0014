/** The messages of docs/protocol.md: strict readers for what the server says. The types come from protocol/schema. */

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
} from './decode';

import type * as wire from './generated';

export type Vec3 = wire.Vector3;
export type Scene = wire.SceneDescription;
export type Method = Omit<wire.MethodDescription, 'params'> & { params: Parameter[] };
/** The kind is any word: one that this client does not know is said so in its form. */
export type Parameter = Omit<wire.ParameterDescription, 'kind'> & { kind: string };
/** The value of a method's parameter; null = automatic. */
export type ParameterValue = wire.ParameterValue;
export type Palette = wire.PaletteDescription;
export type Range = wire.FusionRange;
export type RangeChange = wire.RangeChange;
export type AgeChange = wire.AgeChange;
export type Fusion = wire.FusionState;
export type FusionState = wire.FusionReply;
/** A partial change for fusion.set; what is absent stays, parameters merge. */
export type FusionChange = wire.FusionChange;
export type Quality = wire.QualityState;
export type QualityChange = wire.QualityChange;
export type Catalogue = Omit<wire.Catalogue, 'methods'> & { methods: Method[] };
/** With methods and palettes, or with where they are. */
export type Hello = Omit<wire.Hello, 'methods' | 'palettes' | 'catalogue'> & (Catalogue | { catalogue: string });
export type Facts = wire.FactsReply;
export type Histogram = wire.HistogramReply;
export type Probe = wire.ProbeReply;
export type Baseline = wire.BaselineReply;
export type Extreme = wire.Extreme;
export type Extremes = wire.ExtremesReply;
export type StreamComplete = wire.StreamComplete;
export type StreamStats = wire.StreamStats;
export type Status = wire.Status;
export type RobotMoved = wire.RobotMoved;
export type RpcErrorBody = wire.RpcError;
export type RpcId = wire.RpcId;
export type CameraPose = wire.CameraSet;

export const temperatureSummary = object({
  min: nullable(number),
  max: nullable(number),
  mean: nullable(number),
  sigma: nullable(number),
  missing_count: count,
  over_range_count: count,
  under_range_count: count,
});

const bounds = object({ min: triple(number), max: triple(number) });

export const scene: Decoder<Scene> = object({
  name: string,
  revision: count,
  vertex_count: count,
  triangle_count: count,
  point_cloud: boolean,
  origin: triple(number),
  bounds,
  core_bounds: optional(bounds),
  temperature: temperatureSummary,
  tile_count: count,
  levels: count,
  position_step_m: number,
  up: oneOf('x', 'y', 'z', '-x', '-y', '-z'),
  metric: optional(boolean),
  live: optional(boolean),
  observed: optional(object({ oldest: nullable(number), newest: nullable(number) })),
  baseline: optional(object({ marked_at: nullable(number) })),
  notes: array(object({ id: string, count, message: string })),
});

const parameterValue: Decoder<ParameterValue> = (value, path) => {
  if (value === null || typeof value === 'boolean' || typeof value === 'string') return value;
  return number(value, path);
};

export const parameter: Decoder<Parameter> = object({
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
  automatic: optional(boolean),
});

export const method: Decoder<Method> = object({
  id: string,
  label: string,
  summary: string,
  needs_temperature: boolean,
  uses_palette: boolean,
  wants_fusion_safe_palette: boolean,
  wants_diverging_palette: optional(boolean),
  compares_with_baseline: optional(boolean),
  params: array(parameter),
});

export const palette: Decoder<Palette> = object({
  id: string,
  label: string,
  fusion_safe: boolean,
  diverging: optional(boolean),
  colours: array(triple(number)),
});

export const range: Decoder<Range> = object({
  mode: oneOf('auto', 'manual', 'percentile'),
  min: nullable(number),
  max: nullable(number),
  low: optional(number),
  high: optional(number),
});

export const fusion: Decoder<Fusion> = object({
  method: string,
  params: dictionary(parameterValue),
  params_in_force: dictionary(parameterValue),
  palette: string,
  range,
  missing: string,
  age: optional(object({ mode: oneOf('off', 'fade'), half_life_s: number })),
  change_scale: optional(object({ min: number, max: number })),
});

export const quality: Decoder<Quality> = object({
  mode: oneOf('auto', 'manual'),
  position_step_mm: number,
  colour_bits: count,
  pixel_error: number,
  encoder_speed: count,
  latency_target_ms: number,
  marks: boolean,
});

export const catalogue: Decoder<Catalogue> = object({ methods: array(method), palettes: array(palette) });

const helloWithoutCatalogue = object({
  protocol: oneOf('spectra.v1'),
  server: object({ name: string, version: string }),
  session_id: string,
  role: oneOf('operator', 'viewer'),
  capabilities: array(string),
  limits: object({
    max_message_bytes: count,
    max_depth: count,
    max_requests_per_s: number,
  }),
  scene: nullable(scene),
  fusion,
  quality,
});

export const hello: Decoder<Hello> = (value, path) => {
  const { catalogue: address } = record(value, path);
  return {
    ...helloWithoutCatalogue(value, path),
    ...(address === undefined ? catalogue(value, path) : { catalogue: string(address, `${path}.catalogue`) }),
  };
};

export const fusionState: Decoder<FusionState> = object({ generation: count, fusion });

export const qualityState = object({ quality });

export const facts: Decoder<Facts> = object({
  finite_count: count,
  missing_count: count,
  over_range_count: count,
  under_range_count: count,
  min: number,
  max: number,
  mean: number,
  sigma: number,
  counts: optional(array(count)),
  hues: optional(array(count)),
});

export const histogram: Decoder<Histogram> = object({
  edges: array(number),
  counts: array(number),
  mean: nullable(number),
  sigma: nullable(number),
  highlighted: array(pair(number)),
  highlighted_share: optional(number),
});

export const probe: Decoder<Probe> = object({
  vertex_index: count,
  position: triple(number),
  temperature: nullable(number),
  temperature_range: optional(oneOf('over', 'under')),
  visible: triple(number),
  fused: triple(number),
  distance: number,
  observed_at: optional(nullable(number)),
  baseline: optional(nullable(number)),
  baseline_at: optional(nullable(number)),
  temperature_sigma: optional(number),
  temperature_at: optional(number),
});

export const baseline: Decoder<Baseline> = object({ marked_at: nullable(number), revision: count });

const extreme = object({ position: triple(number), temperature: number });
export const extremes: Decoder<Extremes> = object({
  hottest: nullable(extreme),
  coldest: nullable(extreme),
  over_range: optional(triple(number)),
  under_range: optional(triple(number)),
});

/** `resumed_tiles` is there when the request had `resume`. */
export const subscribed = object({ resumed_tiles: optional(count) });

export const sceneChanged = object({ scene: nullable(scene) });

export const streamComplete: Decoder<StreamComplete> = object({
  generation: count,
  scene_revision: count,
  tiles: count,
  vertices: count,
});

export const streamStats: Decoder<StreamStats> = object({
  round_trip_ms: nullable(number),
  throughput_bytes_per_s: nullable(number),
  queued_bytes: number,
  skipped_frames: count,
  viewers: count,
  accuracy: object({
    position_mm: nullable(number),
    colour_levels: number,
    pixel_error: nullable(number),
    temperature_celsius: nullable(number),
  }),
});

export const robotMoved: Decoder<RobotMoved> = object({
  at: number,
  position: triple(number),
  forward: triple(number),
  up: triple(number),
  lost: optional(boolean),
  path: object({ first: count, points: array(triple(number)) }),
});

export const status: Decoder<Status> = object({
  id: string,
  level: oneOf('info', 'warning', 'error'),
  message: nullable(string),
});

export const rpcError: Decoder<RpcErrorBody> = object({
  code: number,
  message: string,
  data: object({ field: string, reason: string, limits: optional(string) }),
});

/** What the server sends as text: an answer to a request of ours, or a notification. */
export type ServerMessage =
  | { type: 'result'; id: RpcId; result: unknown }
  | { type: 'error'; id: RpcId | null; error: RpcErrorBody }
  | { type: 'notification'; method: string; params: unknown };

const rpcId: Decoder<RpcId> = (value, path) => (typeof value === 'string' ? value : count(value, path));

/** Reads a text message; throws DecodeError or SyntaxError. */
export function decodeServerMessage(text: string): ServerMessage {
  const message = record(JSON.parse(text) as unknown, '');
  if (message['jsonrpc'] !== '2.0') throw new DecodeError('jsonrpc', '"2.0"', message['jsonrpc']);
  if (typeof message['method'] === 'string') {
    return { type: 'notification', method: message['method'], params: message['params'] ?? {} };
  }
  if (message['error'] !== undefined) {
    return { type: 'error', id: nullable(rpcId)(message['id'] ?? null, 'id'), error: rpcError(message['error'], 'error') };
  }
  if (!('result' in message)) throw new DecodeError('', 'a result, an error or a method', text);
  return { type: 'result', id: rpcId(message['id'], 'id'), result: message['result'] };
}
