/** Made by protocol/generate from protocol/schema: types, and readers of what a server says. Not to be edited. */

import type { Decoder } from './decode';
import { array, boolean, count, dictionary, nullable, number, object, oneOf, optional, pair, scalar, string, triple } from './decode';

/** How the age of what was seen is to be shown; what is absent stays. */
export interface AgeChange {
  mode?: AgeMode;
  /** 1 to 10,000,000. */
  half_life_s?: number;
}

export type AgeMode = 'off' | 'fade';

export type BaselineAction = 'mark' | 'get';

/** Result of scene.baseline. */
export interface BaselineReply {
  /**
   * When the temperatures of that moment became the baseline, Unix seconds; null = never: each vertex is compared with
   * what it was when first seen.
   */
  marked_at: number | null;
  /** Of the scene that has it. */
  revision: number;
}

/** Params of scene.baseline. */
export interface BaselineRequest {
  action: BaselineAction;
}

export type BeyondRange = 'over' | 'under';

/** Smallest and largest coordinates, metres relative to the scene origin. */
export interface Bounds {
  min: Vector3;
  max: Vector3;
}

/** Params of the notification camera.set; metres relative to the scene origin. */
export interface CameraSet {
  eye: Position;
  target: Position;
  up: Position;
  fov_y_deg: number;
  /** Width and height, pixels. */
  viewport: [number, number];
}

/** Body of GET /api/v1/catalogue: methods and palettes, the same for every viewer of a server. */
export interface Catalogue {
  methods: MethodDescription[];
  palettes: PaletteDescription[];
}

/** The changes of temperature at the ends of the palette, kelvin. */
export interface ChangeScale {
  min: number;
  /** Above min. */
  max: number;
}

export type Channel = 'fused' | 'temperature' | 'visible' | 'temperature_sigma';

/** r, g, b, sRGB-encoded, real-valued */
export type Colour = [number, number, number];

/** r, g, b */
export type ColourBytes = [number, number, number];

/** colours are written as r, g, b or as g, r - g, b - g */
export type ColourTransform = 'none' | 'subtract_green';

/** An object of no known field. */
export type Empty = object;

/** A place and its temperature, degC. */
export interface Extreme {
  position: Vector3;
  temperature: number;
}

/** Result of scene.extremes; null without thermal data. */
export interface ExtremesReply {
  hottest: Extreme | null;
  coldest: Extreme | null;
  /** A place hotter than the sensor could tell; absent where there is none. */
  over_range?: Vector3;
  /** A place colder than the sensor could tell. */
  under_range?: Vector3;
}

/**
 * Params of scene.extremes. With a camera: of what it sees with nothing in between; where the server has the capability
 * extremes_in_view.
 */
export interface ExtremesRequest {
  camera?: CameraSet;
  /**
   * Left, top, right and bottom of the part of the picture that counts, as shares of its width and height; absent: all of
   * it.
   */
  window?: [number, number, number, number];
}

/**
 * Result of fusion.facts: what automatic values are made of; extremes, mean and sigma are 0 without a finite temperature.
 */
export interface FactsReply {
  finite_count: number;
  missing_count: number;
  over_range_count: number;
  under_range_count: number;
  /** degC, as are the next three. */
  min: number;
  max: number;
  mean: number;
  sigma: number;
  /** Finite temperatures of each of `bins` equal bins from min to max; there when `bins` was given. */
  counts?: number[];
  /**
   * Chroma (largest channel less the smallest) of the visible colours, summed by equal sectors of hue from red on; there
   * when `hues` was asked for.
   */
  hues?: number[];
}

/** Params of fusion.facts. */
export interface FactsRequest {
  /** A histogram of so many bins; absent: none. */
  bins?: number;
  /** Whether the hues of the visible colours are wanted; absent: no. */
  hues?: boolean;
}

export type FrameEncoding = 'png' | 'jpeg' | 'raw16';

/** The head of a message; what it speaks of stands behind it. */
export interface FrameHead {
  kind: FramesKind;
  /** At most 2^53 - 1; chosen by the sender, the answer names it. */
  sequence: number;
  /** Of a picture: its stamp, seconds. */
  time?: number;
  /** Of a picture. */
  sensor?: FrameSensor;
  /** Of a picture. */
  encoding?: FrameEncoding;
  /** Of a raw picture, pixels. */
  width?: number;
  /** Of a raw picture, pixels. */
  height?: number;
  /** Of the camera, and in the sense, that the calibration says. */
  poses?: StampedPose[];
}

export type FrameSensor = 'depth' | 'color' | 'thermal';

/** What may have been sent since the connection began; only ever grows. */
export interface FramesCredit {
  /** Messages. */
  messages: number;
  /** Of messages; the last one may go beyond it. */
  bytes: number;
}

/** Params of the notification frames.hello. */
export interface FramesHello {
  /** spectra.frames.v1 */
  protocol: string;
  limits: FramesLimits;
  credit: FramesCredit;
}

/** what a message of /frames speaks of */
export type FramesKind = 'calibration' | 'poses' | 'corrected_poses' | 'picture' | 'end';

/** What one message may hold. */
export interface FramesLimits {
  /** A larger one ends the connection (1009). */
  max_message_bytes: number;
  /** Of the head. */
  max_head_bytes: number;
}

/** Params of the notification frames.refused: the map is as it was. */
export interface FramesRefused {
  /** Of the message; 0: its head could not be read. */
  sequence: number;
  /** snake_case, stable. */
  code: string;
  /** May be empty. */
  field: string;
  /** One sentence for a person. */
  reason: string;
  credit: FramesCredit;
}

/** Params of the notification frames.taken. */
export interface FramesTaken {
  /** Of the message. */
  sequence: number;
  /** The mapper had no time for the picture. */
  skipped?: boolean;
  /** No more than so many are wanted, of all sensors together; absent: as many as come. */
  pictures_per_s?: number;
  credit: FramesCredit;
}

/** How the age of what was seen is shown. */
export interface FusionAge {
  mode: AgeMode;
  /** After so many seconds half of the colour is left. */
  half_life_s: number;
}

/** Params of fusion.set: any part of FUSION; what is absent stays. */
export interface FusionChange {
  method?: string;
  params?: ParameterValues;
  palette?: string;
  range?: RangeChange;
  missing?: MissingDisplay;
  age?: AgeChange;
}

/** The active temperature range, degC; null without thermal data unless set by hand. */
export interface FusionRange {
  mode: RangeMode;
  min: number | null;
  max: number | null;
  /** Percent of the finite temperatures below min; of percentile only. */
  low?: number;
  /** Percent of the finite temperatures below max; of percentile only. */
  high?: number;
}

/** Result of fusion.set and fusion.get; params of the notification fusion.changed. */
export interface FusionReply {
  /** Number that the colour frames of these settings carry. */
  generation: number;
  fusion: FusionState;
}

/**
 * FUSION: the settings in force. params holds what was set (null = automatic), params_in_force the same with automatic
 * values as numbers (null when the scene has no temperature).
 */
export interface FusionState {
  method: string;
  params: ParameterValues;
  params_in_force: ParameterValues;
  palette: string;
  range: FusionRange;
  missing: MissingDisplay;
  age?: FusionAge;
  /** What the palette stands for where it shows changes of temperature; absent: the range. */
  change_scale?: ChangeScale;
}

/** Params of the notification hello, the first message of every connection. */
export interface Hello {
  protocol: 'spectra.v1';
  server: ServerInfo;
  /** Opaque; see "Resuming after a drop-out". */
  session_id: string;
  role: Role;
  /** Names of optional parts that this server has. */
  capabilities: string[];
  limits: Limits;
  /** null: no scene yet. */
  scene: SceneDescription | null;
  /** Absent in the brief form. */
  methods?: MethodDescription[];
  /** Absent in the brief form. */
  palettes?: PaletteDescription[];
  /** Of the brief form only: where methods and palettes are, a path relative to the folder of `/ws`. */
  catalogue?: string;
  fusion: FusionState;
  quality: QualityState;
}

/** Result of scene.histogram; without thermal data every list is empty, mean and sigma are null. */
export interface HistogramReply {
  /** bins + 1 temperatures, degC. */
  edges: number[];
  /** Vertices per bin. */
  counts: number[];
  mean: number | null;
  sigma: number | null;
  /**
   * Intervals [low, high] that the current method highlights, degC; one of the lowest or the highest alone: what is beyond
   * the sensor's range there.
   */
  highlighted: [number, number][];
  /**
   * Share of the surface (of points: of the vertices) that the current method highlights; absent for a method that shows
   * all temperatures alike.
   */
  highlighted_share?: number;
}

/** Params of scene.histogram. */
export interface HistogramRequest {
  bins: number;
}

/** Params of the notification ingest.acknowledged: the change is part of the map, and durable where there is a store. */
export interface IngestAcknowledged {
  /** Of the message. */
  sequence: number;
  /** Of the block; of the change, when one was taken out. */
  revision: number;
  /** What was noticed in the block; left out when there is nothing. */
  notes?: SceneNote[];
  credit: IngestCredit;
}

/** What may have been sent since the connection began; only ever grows. */
export interface IngestCredit {
  /** Messages. */
  blocks: number;
  /** Of messages; the last one may go beyond it. */
  bytes: number;
}

/** Params of the notification ingest.hello. */
export interface IngestHello {
  /** spectra.ingest.v1 */
  protocol: string;
  limits: IngestLimits;
  credit: IngestCredit;
}

/** What one message may hold. */
export interface IngestLimits {
  /** PLY. */
  max_block_bytes: number;
  /** Name and query. */
  max_target_bytes: number;
}

/** Params of the notification ingest.refused: the map is as it was. */
export interface IngestRefused {
  /** Of the message. */
  sequence: number;
  /** snake_case, stable. */
  code: string;
  /** What is wrong; may be empty. */
  field: string;
  /** One sentence for a person. */
  reason: string;
  /** What would be accepted, for a person; left out when there is nothing to say. */
  limits?: string;
  credit: IngestCredit;
}

/** What a client must keep to. */
export interface Limits {
  /** Largest text message from a client; a larger one closes with 1009. */
  max_message_bytes: number;
  /** Deepest nesting of JSON. */
  max_depth: number;
  /** More are answered with -32003. */
  max_requests_per_s: number;
}

/** METHOD. */
export interface MethodDescription {
  id: string;
  label: string;
  summary: string;
  needs_temperature: boolean;
  uses_palette: boolean;
  /** A palette that is not fusion_safe loses temperature with this method. */
  wants_fusion_safe_palette: boolean;
  /** A palette that is not diverging does not tell warmer from colder with this method. Absent: false. */
  wants_diverging_palette?: boolean;
  /**
   * It shows how temperatures differ from the vertices' baseline; where there is none it shows the visible colours.
   * Absent: false.
   */
  compares_with_baseline?: boolean;
  params: ParameterDescription[];
}

/** how vertices without temperature are shown */
export type MissingDisplay = string;

/** PALETTE. */
export interface PaletteDescription {
  id: string;
  label: string;
  /** Carries temperature by hue alone. */
  fusion_safe: boolean;
  /** Tells two directions from a neutral middle. Absent: false. */
  diverging?: boolean;
  /** Row 0 is the coldest. */
  colours: Colour[];
}

/** One parameter of a method; enough to build its form. A bound that is absent is none. */
export interface ParameterDescription {
  name: string;
  label: string;
  help: string;
  kind: ParameterKind;
  default: ParameterValue;
  /** Smallest value, allowed itself. */
  min?: number;
  /** Largest value, allowed itself. */
  max?: number;
  /** Lower bound that is itself refused. */
  exclusive_min?: number;
  /** A sensible slider step. */
  step?: number;
  unit?: string;
  /** Ids of a choice. */
  options?: string[];
  /** Whether null = automatic is allowed; absent: it is not. */
  automatic?: boolean;
}

export type ParameterKind = string;

/** by the parameter's kind; null = automatic */
export type ParameterValue = number | string | boolean | null;

/** by the name of the parameter */
export type ParameterValues = Record<string, ParameterValue>;

/** x, y, z, metres relative to the scene origin */
export type Position = [number, number, number];

/** Result of scene.probe: the nearest vertex at full accuracy. */
export interface ProbeReply {
  /** In the input's order. */
  vertex_index: number;
  position: Vector3;
  /** degC; null = missing, or beyond the sensor's range. */
  temperature: number | null;
  /** The reading is beyond the sensor's range, hotter or colder than it could tell; absent otherwise. */
  temperature_range?: BeyondRange;
  visible: ColourBytes;
  fused: ColourBytes;
  /** Metres. */
  distance: number;
  /** When the vertex was seen, Unix seconds; null = not known. */
  observed_at?: number | null;
  /** What its temperature is compared with, degC; null = nothing, or beyond the sensor's range. */
  baseline?: number | null;
  /** The time that is of, Unix seconds; null = not known. */
  baseline_at?: number | null;
  /**
   * Standard deviation of the temperature, kelvin, apart from the camera's absolute error; absent where nobody says how
   * sure it is.
   */
  temperature_sigma?: number;
  /** When the thermal camera last looked there, Unix seconds; absent where it is not known. */
  temperature_at?: number;
}

/** Params of scene.probe. */
export interface ProbeRequest {
  position: Position;
}

/** Params of quality.set; what is absent stays. */
export interface QualityChange {
  mode?: QualityMode;
  position_step_mm?: number;
  colour_bits?: number;
  pixel_error?: number;
  encoder_speed?: number;
  latency_target_ms?: number;
  /** Colours carry which vertices the method highlights. */
  marks?: boolean;
}

export type QualityMode = 'auto' | 'manual';

/** Result of quality.set. */
export interface QualityReply {
  quality: QualityState;
}

/** QUALITY: the knobs in force. */
export interface QualityState {
  mode: QualityMode;
  /** Lattice step; the largest error per axis is half of it. */
  position_step_mm: number;
  colour_bits: number;
  /** Largest error on the screen, pixels. */
  pixel_error: number;
  /** Draco speed: 0 smallest, 10 fastest. */
  encoder_speed: number;
  /** Aim of mode auto. */
  latency_target_ms: number;
  /** Colours carry which vertices the method highlights. */
  marks: boolean;
}

/**
 * mode auto, or mode manual with min and max (degC, min <= max), or mode percentile with low and high (percent, low <
 * high).
 */
export interface RangeChange {
  mode: RangeMode;
  min?: number | null;
  max?: number | null;
  /** Percent of the finite temperatures below the range; of percentile, 1 when absent. */
  low?: number;
  /** Percent of the finite temperatures below its upper end; of percentile, 99 when absent. */
  high?: number;
}

export type RangeMode = 'auto' | 'manual' | 'percentile';

/** Tiles that the client still has, with colours, from an earlier connection. */
export interface ResumeRequest {
  /** Of the hello of that connection. */
  session_id: string;
  /** Those it holds. */
  tiles: [number, number, number, number, number][];
  /** Places in `tiles` of those of which it has both raw layers, in the form that it asks for now; absent: none. */
  raw?: number[];
  /** Places in `tiles` of those of which it has how sure temperatures are; absent: none. */
  temperature_sigma?: number[];
  /**
   * Which colours it holds: a place in `tiles`, and the sequence of the frame that brought them on that connection, 0
   * where they are as that connection's own resume named them. Absent: colours come anew.
   */
  colours?: [number, number][];
}

/** Params of the notification robot.moved. */
export interface RobotMoved {
  /** Unix seconds. */
  at: number;
  /** Of its depth camera: metres, in the coordinates of the map; minus SCENE.origin they are those of the scene. */
  position: Vector3;
  /** Where that looks; of length 1. */
  forward: Vector3;
  /** Up in its picture; of length 1. */
  up: Vector3;
  /** True: it does not know where it is, and this is where it was last. */
  lost?: boolean;
  path: RobotPath;
}

/** A part of the way the robot has come. */
export interface RobotPath {
  /** What the client has of the way from this point on is replaced. */
  first: number;
  /** Metres, in the coordinates of the map. */
  points: Vector3[];
}

export type Role = 'operator' | 'viewer';

/** A refusal; a refused request changes nothing. */
export interface RpcError {
  /**
   * -32700 parse, -32600 request, -32601 method, -32602 params, -32603 internal, -32001 unauthorised, -32002 forbidden,
   * -32003 busy, -32004 no scene.
   */
  code: number;
  message: string;
  data: RpcErrorData;
}

/** What was wrong and what would be accepted. */
export interface RpcErrorData {
  /** Path such as params.alpha; empty: the message itself. */
  field: string;
  reason: string;
  limits?: string;
}

/** Server to client. */
export interface RpcFailure {
  jsonrpc: '2.0';
  /** null: the message had no usable id. */
  id: number | string | null;
  error: RpcError;
}

/** Chosen by the client. */
export type RpcId = number | string;

/** Either direction; never answered, except that one which cannot be carried out is reported by RpcFailure with id null. */
export interface RpcNotification {
  jsonrpc: '2.0';
  method: string;
  params?: object;
}

/** Client to server; answered by RpcResult or RpcFailure of the same id. */
export interface RpcRequest {
  jsonrpc: '2.0';
  id: RpcId;
  method: string;
  params?: object;
}

/** Server to client. */
export interface RpcResult {
  jsonrpc: '2.0';
  id: RpcId;
  result: object;
}

/** What temperatures are compared with. */
export interface SceneBaseline {
  /** When the baseline was marked, Unix seconds; null = never: each vertex is compared with what it was when first seen. */
  marked_at: number | null;
}

/** Params of the notification scene.changed. */
export interface SceneChanged {
  scene: SceneDescription;
}

/**
 * SCENE: what is served. origin: metres, double precision, in the coordinates of the input file. core_bounds: bounds
 * without the few vertices that lie far from everything else.
 */
export interface SceneDescription {
  name: string;
  /** Rises with every change of the scene. */
  revision: number;
  vertex_count: number;
  triangle_count: number;
  point_cloud: boolean;
  origin: Vector3;
  bounds: Bounds;
  core_bounds?: Bounds;
  temperature: SceneTemperature;
  tile_count: number;
  /** Levels of the tile tree. */
  levels: number;
  /** Default step of the positions, metres; the largest where tiles differ. */
  position_step_m: number;
  up: UpAxis;
  /**
   * Whether somebody (the file, or who serves it) has said that positions are in metres; otherwise they are taken for it.
   * Absent: unknown.
   */
  metric?: boolean;
  /** A map that began empty and is expected to grow. */
  live?: boolean;
  observed?: SceneObserved;
  /** Absent in a scene that does not remember, as a file. */
  baseline?: SceneBaseline;
  /** Of some vertices it is known how sure their temperature is. Absent: of none. */
  has_temperature_sigma?: boolean;
  /** What loading noticed. */
  notes: SceneNote[];
}

/** Something that was repaired, left out or interpreted while the scene was read. */
export interface SceneNote {
  /** snake_case, stable. */
  id: string;
  count: number;
  /** One sentence for a person, with the count. */
  message: string;
}

/** When parts of the scene were seen, Unix seconds; of the parts of which that is known. */
export interface SceneObserved {
  oldest: number | null;
  newest: number | null;
}

/** Facts of all temperatures of the scene, degC; null without thermal data. */
export interface SceneTemperature {
  min: number | null;
  max: number | null;
  mean: number | null;
  /** Population standard deviation. */
  sigma: number | null;
  /** Vertices without temperature. */
  missing_count: number;
  /** Vertices hotter than the sensor could tell; in no other fact. */
  over_range_count: number;
  /** Vertices colder than the sensor could tell. */
  under_range_count: number;
}

/** Who serves. */
export interface ServerInfo {
  name: string;
  version: string;
}

/** stamp in seconds, position in metres, orientation x y z w */
export type StampedPose = number[];

/** Params of the notification status; the same id replaces, message null clears. */
export interface Status {
  id: string;
  level: StatusLevel;
  message: string | null;
}

export type StatusLevel = 'info' | 'warning' | 'error';

/** What is on the screen now. */
export interface StreamAccuracy {
  /** Largest error per axis. */
  position_mm: number | null;
  /** Levels of a colour channel that can be told apart; coarse tiles count. */
  colour_levels: number;
  pixel_error: number | null;
  /** Of temperatures, for 95 % of the surface; null: there are none. */
  temperature_celsius: number | null;
}

/** Params of the notification stream.ack. */
export interface StreamAck {
  /** Every frame up to this one is decoded. */
  sequence: number;
}

/** Params of the notification stream.complete: all that camera and quality ask for has been sent. */
export interface StreamComplete {
  generation: number;
  scene_revision: number;
  tiles: number;
  vertices: number;
}

/** Params of the notification stream.stats. */
export interface StreamStats {
  /** null: not measured yet. */
  round_trip_ms: number | null;
  /** null: not measured yet. */
  throughput_bytes_per_s: number | null;
  queued_bytes: number;
  /** Superseded before they were sent. */
  skipped_frames: number;
  /** Connected now. */
  viewers: number;
  accuracy: StreamAccuracy;
  /** Of the settings in force. */
  generation: number;
  /**
   * All that is to be drawn has been sent in that generation as it was in this revision of the scene, or later. Of a map
   * that changes all the time it rises, while stream.complete hardly ever comes.
   */
  scene_revision: number;
}

/** Result of scene.subscribe. */
export interface SubscribeReply {
  /** There when the request had `resume`: how many of the claimed tiles are current and are not sent again. */
  resumed_tiles?: number;
  /**
   * There when `resume` had `colours`: places in `tiles` of those whose colours are what the settings in force give,
   * rounded to no fewer bits, so that they are not sent again either. Empty where nothing is known of the connection.
   */
  current_colours?: number[];
  /** There with `current_colours`: the generation that those colours count as. 0: there is no scene yet. */
  generation?: number;
}

/** Params of scene.subscribe. */
export interface SubscribeRequest {
  channels: Channel[];
  /** Most frame bytes beyond the last stream.ack; absent: the server's choice. */
  in_flight_bytes?: number;
  /** Most bytes of decoded tiles (16 a vertex, 12 a triangle) held by the client; absent: no bound to what it asks for. */
  cache_bytes?: number;
  /** How colours are written: frames of kind 2, or of kind 6. Absent: none. */
  colour_transform?: ColourTransform;
  /** Step of the channel temperature; absent: the larger of 0.01 degC and a 65,000th of the tile's span. */
  temperature_step_celsius?: number;
  /** Absent: the client holds nothing. Refused while frames flow. */
  resume?: ResumeRequest;
}

export type UpAxis = 'x' | 'y' | 'z' | '-x' | '-y' | '-z';

/** x, y, z, metres */
export type Vector3 = [number, number, number];

export const bounds: Decoder<Bounds> = object({
  min: triple(number),
  max: triple(number),
});

export const sceneTemperature: Decoder<SceneTemperature> = object({
  min: nullable(number),
  max: nullable(number),
  mean: nullable(number),
  sigma: nullable(number),
  missing_count: count,
  over_range_count: count,
  under_range_count: count,
});

export const sceneObserved: Decoder<SceneObserved> = object({
  oldest: nullable(number),
  newest: nullable(number),
});

export const sceneBaseline: Decoder<SceneBaseline> = object({
  marked_at: nullable(number),
});

export const sceneNote: Decoder<SceneNote> = object({
  id: string,
  count: count,
  message: string,
});

export const sceneDescription: Decoder<SceneDescription> = object({
  name: string,
  revision: count,
  vertex_count: count,
  triangle_count: count,
  point_cloud: boolean,
  origin: triple(number),
  bounds: bounds,
  core_bounds: optional(bounds),
  temperature: sceneTemperature,
  tile_count: count,
  levels: count,
  position_step_m: number,
  up: oneOf('x', 'y', 'z', '-x', '-y', '-z'),
  metric: optional(boolean),
  live: optional(boolean),
  observed: optional(sceneObserved),
  baseline: optional(sceneBaseline),
  has_temperature_sigma: optional(boolean),
  notes: array(sceneNote),
});

export const subscribeReply: Decoder<SubscribeReply> = object({
  resumed_tiles: optional(count),
  current_colours: optional(array(count)),
  generation: optional(count),
});

export const fusionRange: Decoder<FusionRange> = object({
  mode: oneOf('auto', 'manual', 'percentile'),
  min: nullable(number),
  max: nullable(number),
  low: optional(number),
  high: optional(number),
});

export const fusionAge: Decoder<FusionAge> = object({
  mode: oneOf('off', 'fade'),
  half_life_s: number,
});

export const changeScale: Decoder<ChangeScale> = object({
  min: number,
  max: number,
});

export const fusionState: Decoder<FusionState> = object({
  method: string,
  params: dictionary(scalar),
  params_in_force: dictionary(scalar),
  palette: string,
  range: fusionRange,
  missing: string,
  age: optional(fusionAge),
  change_scale: optional(changeScale),
});

export const fusionReply: Decoder<FusionReply> = object({
  generation: count,
  fusion: fusionState,
});

export const factsReply: Decoder<FactsReply> = object({
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

export const qualityState: Decoder<QualityState> = object({
  mode: oneOf('auto', 'manual'),
  position_step_mm: number,
  colour_bits: count,
  pixel_error: number,
  encoder_speed: count,
  latency_target_ms: number,
  marks: boolean,
});

export const qualityReply: Decoder<QualityReply> = object({
  quality: qualityState,
});

export const histogramReply: Decoder<HistogramReply> = object({
  edges: array(number),
  counts: array(count),
  mean: nullable(number),
  sigma: nullable(number),
  highlighted: array(pair(number)),
  highlighted_share: optional(number),
});

export const probeReply: Decoder<ProbeReply> = object({
  vertex_index: count,
  position: triple(number),
  temperature: nullable(number),
  temperature_range: optional(oneOf('over', 'under')),
  visible: triple(count),
  fused: triple(count),
  distance: number,
  observed_at: optional(nullable(number)),
  baseline: optional(nullable(number)),
  baseline_at: optional(nullable(number)),
  temperature_sigma: optional(number),
  temperature_at: optional(number),
});

export const extreme: Decoder<Extreme> = object({
  position: triple(number),
  temperature: number,
});

export const extremesReply: Decoder<ExtremesReply> = object({
  hottest: nullable(extreme),
  coldest: nullable(extreme),
  over_range: optional(triple(number)),
  under_range: optional(triple(number)),
});

export const baselineReply: Decoder<BaselineReply> = object({
  marked_at: nullable(number),
  revision: count,
});

export const serverInfo: Decoder<ServerInfo> = object({
  name: string,
  version: string,
});

export const limits: Decoder<Limits> = object({
  max_message_bytes: count,
  max_depth: count,
  max_requests_per_s: number,
});

export const parameterDescription: Decoder<ParameterDescription> = object({
  name: string,
  label: string,
  help: string,
  kind: string,
  default: scalar,
  min: optional(number),
  max: optional(number),
  exclusive_min: optional(number),
  step: optional(number),
  unit: optional(string),
  options: optional(array(string)),
  automatic: optional(boolean),
});

export const methodDescription: Decoder<MethodDescription> = object({
  id: string,
  label: string,
  summary: string,
  needs_temperature: boolean,
  uses_palette: boolean,
  wants_fusion_safe_palette: boolean,
  wants_diverging_palette: optional(boolean),
  compares_with_baseline: optional(boolean),
  params: array(parameterDescription),
});

export const paletteDescription: Decoder<PaletteDescription> = object({
  id: string,
  label: string,
  fusion_safe: boolean,
  diverging: optional(boolean),
  colours: array(triple(number)),
});

export const hello: Decoder<Hello> = object({
  protocol: oneOf('spectra.v1'),
  server: serverInfo,
  session_id: string,
  role: oneOf('operator', 'viewer'),
  capabilities: array(string),
  limits: limits,
  scene: nullable(sceneDescription),
  methods: optional(array(methodDescription)),
  palettes: optional(array(paletteDescription)),
  catalogue: optional(string),
  fusion: fusionState,
  quality: qualityState,
});

export const sceneChanged: Decoder<SceneChanged> = object({
  scene: sceneDescription,
});

export const streamComplete: Decoder<StreamComplete> = object({
  generation: count,
  scene_revision: count,
  tiles: count,
  vertices: count,
});

export const robotPath: Decoder<RobotPath> = object({
  first: count,
  points: array(triple(number)),
});

export const robotMoved: Decoder<RobotMoved> = object({
  at: number,
  position: triple(number),
  forward: triple(number),
  up: triple(number),
  lost: optional(boolean),
  path: robotPath,
});

export const streamAccuracy: Decoder<StreamAccuracy> = object({
  position_mm: nullable(number),
  colour_levels: count,
  pixel_error: nullable(number),
  temperature_celsius: nullable(number),
});

export const streamStats: Decoder<StreamStats> = object({
  round_trip_ms: nullable(number),
  throughput_bytes_per_s: nullable(number),
  queued_bytes: count,
  skipped_frames: count,
  viewers: count,
  accuracy: streamAccuracy,
  generation: count,
  scene_revision: count,
});

export const status: Decoder<Status> = object({
  id: string,
  level: oneOf('info', 'warning', 'error'),
  message: nullable(string),
});

export const catalogue: Decoder<Catalogue> = object({
  methods: array(methodDescription),
  palettes: array(paletteDescription),
});

export const rpcErrorData: Decoder<RpcErrorData> = object({
  field: string,
  reason: string,
  limits: optional(string),
});

export const rpcError: Decoder<RpcError> = object({
  code: number,
  message: string,
  data: rpcErrorData,
});
