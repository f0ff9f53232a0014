/** The messages of docs/protocol.md under this client's own, shorter names. What they are made of comes from protocol/schema. */

import { count, DecodeError, type Decoder, nullable, record } from './decode';
import type * as wire from './generated';
import { catalogue, hello as helloOfAnyForm, rpcError } from './generated';

export type Vec3 = wire.Vector3;
export type Scene = wire.SceneDescription;
export type Method = wire.MethodDescription;
export type Parameter = wire.ParameterDescription;
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
export type Catalogue = wire.Catalogue;
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
export type RpcErrorBody = wire.RpcError;
export type RpcId = wire.RpcId;
export type CameraPose = wire.CameraSet;
export type RobotMoved = wire.RobotMoved;

export {
  baselineReply as baseline,
  catalogue,
  extremesReply as extremes,
  factsReply as facts,
  fusionReply as fusionState,
  fusionState as fusion,
  histogramReply as histogram,
  probeReply as probe,
  qualityReply as qualityState,
  robotMoved,
  sceneChanged,
  sceneDescription as scene,
  status,
  streamComplete,
  streamStats,
  subscribeReply as subscribed,
} from './generated';

export const hello: Decoder<Hello> = (value, path) => {
  const { methods: _methods, palettes: _palettes, catalogue: address, ...rest } = helloOfAnyForm(value, path);
  return { ...rest, ...(address === undefined ? catalogue(value, path) : { catalogue: address }) };
};

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
