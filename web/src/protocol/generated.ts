// Made by `npm run generate` from protocol/schema. Not to be edited.

export type AgeMode = "off" | "fade";
export type BaselineAction = "mark" | "get";
export type BeyondRange = "over" | "under";
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector3 = [number, number, number];
export type ParameterKind = "number" | "integer" | "toggle" | "choice" | "temperature";
/**
 * number, integer, toggle (boolean), choice (string) or temperature (degC; null = automatic).
 */
export type ParameterValue = number | string | boolean | null;
/**
 * r, g, b, sRGB-encoded, 0..255.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Colour = [number, number, number];
export type Channel = "fused" | "temperature" | "visible";
/**
 * r, g, b.
 *
 * @minItems 3
 * @maxItems 3
 */
export type ColourBytes = [number, number, number];
/**
 * How colours are written: none = frames of kind 2 (r, g, b), subtract_green = kind 6 (g and r - g, b - g).
 */
export type ColourTransform = "none" | "subtract_green";
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector31 = [number, number, number];
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector32 = [number, number, number];
export type RangeMode = "auto" | "manual" | "percentile";
/**
 * How vertices without temperature are shown: "visible" or a colour "#rrggbb".
 */
export type MissingDisplay = string;
export type UpAxis = "x" | "y" | "z" | "-x" | "-y" | "-z";
export type QualityMode = "auto" | "manual";
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector33 = [number, number, number];
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector34 = [number, number, number];
/**
 * x, y, z in metres.
 *
 * @minItems 3
 * @maxItems 3
 */
export type Vector35 = [number, number, number];
/**
 * Chosen by the client.
 */
export type RpcId = number | string;
export type StatusLevel = "info" | "warning" | "error";

export interface ProtocolDefinitions {
  AgeChange: AgeChange;
  AgeMode: AgeMode;
  BaselineAction: BaselineAction;
  BaselineReply: BaselineReply;
  BaselineRequest: BaselineRequest;
  BeyondRange: BeyondRange;
  Bounds: Bounds;
  CameraSet: CameraSet;
  Catalogue: Catalogue;
  ChangeScale: ChangeScale;
  Channel: Channel;
  Colour: Colour;
  ColourBytes: ColourBytes;
  ColourTransform: ColourTransform;
  Empty: Empty;
  Extreme: Extreme;
  ExtremesReply: ExtremesReply;
  ExtremesRequest: ExtremesRequest;
  FactsReply: FactsReply;
  FactsRequest: FactsRequest;
  FusionAge: FusionAge;
  FusionChange: FusionChange;
  FusionRange: FusionRange;
  FusionReply: FusionReply;
  FusionState: FusionState;
  Hello: Hello;
  HistogramReply: HistogramReply;
  HistogramRequest: HistogramRequest;
  IngestAcknowledged: IngestAcknowledged;
  IngestCredit: IngestCredit;
  IngestHello: IngestHello;
  IngestLimits: IngestLimits;
  IngestRefused: IngestRefused;
  Limits: Limits;
  MethodDescription: MethodDescription;
  MissingDisplay: MissingDisplay;
  PaletteDescription: PaletteDescription;
  ParameterDescription: ParameterDescription;
  ParameterKind: ParameterKind;
  ParameterValue: ParameterValue;
  ParameterValues: ParameterValues;
  ProbeReply: ProbeReply;
  ProbeRequest: ProbeRequest;
  QualityChange: QualityChange;
  QualityMode: QualityMode;
  QualityReply: QualityReply;
  QualityState: QualityState;
  RangeChange: RangeChange;
  RangeMode: RangeMode;
  ResumeRequest: ResumeRequest;
  RobotMoved: RobotMoved;
  RobotPath: RobotPath;
  RpcError: RpcError;
  RpcErrorData: RpcErrorData;
  RpcFailure: RpcFailure;
  RpcId: RpcId;
  RpcNotification: RpcNotification;
  RpcRequest: RpcRequest;
  RpcResult: RpcResult;
  SceneBaseline: SceneBaseline1;
  SceneChanged: SceneChanged;
  SceneDescription: SceneDescription;
  SceneNote: SceneNote;
  SceneObserved: SceneObserved;
  SceneTemperature: SceneTemperature;
  ServerInfo: ServerInfo;
  Status: Status;
  StatusLevel: StatusLevel;
  StreamAccuracy: StreamAccuracy;
  StreamAck: StreamAck;
  StreamComplete: StreamComplete;
  StreamStats: StreamStats;
  SubscribeReply: SubscribeReply;
  SubscribeRequest: SubscribeRequest;
  UpAxis: UpAxis;
  Vector3: Vector3;
}
/**
 * The same as it is set; what is absent stays.
 */
export interface AgeChange {
  mode?: AgeMode;
  /**
   * 1 to 10,000,000.
   */
  half_life_s?: number;
}
/**
 * Result of scene.baseline.
 */
export interface BaselineReply {
  /**
   * When the temperatures of that moment became the baseline, Unix seconds; null = never: each vertex is compared with what it was when first seen.
   */
  marked_at: number | null;
  /**
   * Of the scene that has it.
   */
  revision: number;
}
/**
 * Params of scene.baseline.
 */
export interface BaselineRequest {
  action: BaselineAction;
}
/**
 * Smallest and largest coordinates, metres relative to the scene origin.
 */
export interface Bounds {
  min: Vector3;
  max: Vector3;
}
/**
 * Params of the notification camera.set; metres relative to the scene origin.
 */
export interface CameraSet {
  eye: Vector3;
  target: Vector3;
  up: Vector3;
  fov_y_deg: number;
  /**
   * Width and height, pixels.
   *
   * @minItems 2
   * @maxItems 2
   */
  viewport: [number, number];
}
/**
 * Body of GET /api/v1/catalogue: methods and palettes, the same for every viewer of a server.
 */
export interface Catalogue {
  methods: MethodDescription[];
  palettes: PaletteDescription[];
}
/**
 * METHOD.
 */
export interface MethodDescription {
  id: string;
  label: string;
  summary: string;
  needs_temperature: boolean;
  uses_palette: boolean;
  /**
   * A palette that is not fusion_safe loses temperature with this method.
   */
  wants_fusion_safe_palette: boolean;
  /**
   * A palette that is not diverging does not tell warmer from colder with this method. Absent: false.
   */
  wants_diverging_palette?: boolean;
  /**
   * It shows how temperatures differ from the vertices' baseline; where there is none it shows the visible colours. Absent: false.
   */
  compares_with_baseline?: boolean;
  params: ParameterDescription[];
}
/**
 * One parameter of a method; enough to build its form. A bound that is absent is none.
 */
export interface ParameterDescription {
  name: string;
  label: string;
  help: string;
  kind: ParameterKind;
  default: ParameterValue;
  /**
   * Smallest value, allowed itself.
   */
  min?: number;
  /**
   * Largest value, allowed itself.
   */
  max?: number;
  /**
   * Lower bound that is itself refused.
   */
  exclusive_min?: number;
  /**
   * A sensible slider step.
   */
  step?: number;
  unit?: string;
  /**
   * Ids of a choice.
   */
  options?: string[];
  /**
   * Whether null = automatic is allowed; absent: it is not.
   */
  automatic?: boolean;
}
/**
 * PALETTE.
 */
export interface PaletteDescription {
  id: string;
  label: string;
  /**
   * Carries temperature by hue alone.
   */
  fusion_safe: boolean;
  /**
   * Tells two directions from a neutral middle. Absent: false.
   */
  diverging?: boolean;
  /**
   * Row 0 is the coldest.
   */
  colours: Colour[];
}
/**
 * The changes of temperature at the ends of the palette, kelvin.
 */
export interface ChangeScale {
  min: number;
  /**
   * Above min.
   */
  max: number;
}
/**
 * An object of no known field.
 */
export interface Empty {}
/**
 * A place and its temperature, degC.
 */
export interface Extreme {
  position: Vector3;
  temperature: number;
}
/**
 * Result of scene.extremes; null without thermal data.
 */
export interface ExtremesReply {
  hottest: Extreme | null;
  coldest: Extreme | null;
  over_range?: Vector31;
  under_range?: Vector32;
}
/**
 * Params of scene.extremes. With a camera: of what it sees with nothing in between; where the server has the capability extremes_in_view.
 */
export interface ExtremesRequest {
  camera?: CameraSet;
  /**
   * Left, top, right and bottom of the part of the picture that counts, as shares of its width and height; absent: all of it.
   *
   * @minItems 4
   * @maxItems 4
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
  min: number;
  max: number;
  mean: number;
  sigma: number;
  /**
   * Of bins equal bins from min to max; there when bins was given.
   */
  counts?: number[];
  /**
   * Chroma (largest channel less the smallest) of the visible colours, summed by equal sectors of hue from red on; there when hues was asked for.
   */
  hues?: number[];
}
/**
 * Params of fusion.facts.
 */
export interface FactsRequest {
  /**
   * Absent: no histogram.
   */
  bins?: number;
  /**
   * Absent: no.
   */
  hues?: boolean;
}
/**
 * How the age of what was seen is shown.
 */
export interface FusionAge {
  mode: AgeMode;
  /**
   * After so many seconds half of the colour is left.
   */
  half_life_s: number;
}
/**
 * Params of fusion.set: any part of FUSION; what is absent stays.
 */
export interface FusionChange {
  method?: string;
  params?: ParameterValues;
  palette?: string;
  range?: RangeChange;
  missing?: MissingDisplay;
  age?: AgeChange;
}
/**
 * Parameter name to value.
 */
export interface ParameterValues {
  [k: string]: ParameterValue;
}
/**
 * mode auto, or mode manual with min and max (degC, min <= max), or mode percentile with low and high (percent, low < high).
 */
export interface RangeChange {
  mode: RangeMode;
  min?: number | null;
  max?: number | null;
  /**
   * Percent of the finite temperatures below the range; of percentile, 1 when absent.
   */
  low?: number;
  /**
   * Percent of the finite temperatures below its upper end; of percentile, 99 when absent.
   */
  high?: number;
}
/**
 * The active temperature range, degC; null without thermal data unless set by hand.
 */
export interface FusionRange {
  mode: RangeMode;
  min: number | null;
  max: number | null;
  /**
   * Percent of the finite temperatures below min; of percentile only.
   */
  low?: number;
  /**
   * Percent of the finite temperatures below max; of percentile only.
   */
  high?: number;
}
/**
 * Result of fusion.set and fusion.get; params of the notification fusion.changed.
 */
export interface FusionReply {
  /**
   * Number that the colour frames of these settings carry.
   */
  generation: number;
  fusion: FusionState;
}
/**
 * FUSION: the settings in force. params holds what was set (null = automatic), params_in_force the same with automatic temperatures as numbers (null when the scene has none).
 */
export interface FusionState {
  method: string;
  params: ParameterValues;
  params_in_force: ParameterValues;
  palette: string;
  range: FusionRange;
  missing: MissingDisplay;
  age?: FusionAge;
  change_scale?: ChangeScale1;
}
/**
 * The changes of temperature at the ends of the palette, kelvin.
 */
export interface ChangeScale1 {
  min: number;
  /**
   * Above min.
   */
  max: number;
}
/**
 * Params of the notification hello, the first message of every connection.
 */
export interface Hello {
  protocol: "spectra.v1";
  server: ServerInfo;
  session_id: string;
  role: "operator" | "viewer";
  /**
   * Names of optional parts that this server has.
   */
  capabilities: string[];
  limits: Limits;
  /**
   * null: no scene yet.
   */
  scene: SceneDescription | null;
  /**
   * Absent in the brief form.
   */
  methods?: MethodDescription[];
  /**
   * Absent in the brief form.
   */
  palettes?: PaletteDescription[];
  /**
   * Of the brief form only: where methods and palettes are, a path relative to the folder of /ws.
   */
  catalogue?: string;
  fusion: FusionState;
  quality: QualityState;
}
/**
 * Who serves.
 */
export interface ServerInfo {
  name: string;
  version: string;
}
/**
 * What a client must keep to.
 */
export interface Limits {
  /**
   * Largest text message from a client; a larger one closes with 1009.
   */
  max_message_bytes: number;
  /**
   * Deepest nesting of JSON.
   */
  max_depth: number;
  /**
   * More are answered with -32003.
   */
  max_requests_per_s: number;
}
/**
 * SCENE: what is served. origin: metres, double precision, in the coordinates of the input file. core_bounds: bounds without the few vertices that lie far from everything else.
 */
export interface SceneDescription {
  name: string;
  /**
   * Rises with every change of the scene.
   */
  revision: number;
  vertex_count: number;
  triangle_count: number;
  point_cloud: boolean;
  origin: Vector3;
  bounds: Bounds;
  core_bounds?: Bounds;
  temperature: SceneTemperature;
  tile_count: number;
  /**
   * Levels of the tile tree.
   */
  levels: number;
  /**
   * Default step of the positions, metres; the largest where tiles differ.
   */
  position_step_m: number;
  up: UpAxis;
  /**
   * Whether somebody (the file, or who serves it) has said that positions are in metres; otherwise they are taken for it. Absent: unknown.
   */
  metric?: boolean;
  /**
   * A map that began empty and is expected to grow.
   */
  live?: boolean;
  observed?: SceneObserved;
  baseline?: SceneBaseline;
  /**
   * What loading noticed.
   */
  notes: SceneNote[];
}
/**
 * Facts of all temperatures of the scene, degC; null without thermal data.
 */
export interface SceneTemperature {
  min: number | null;
  max: number | null;
  mean: number | null;
  /**
   * Population standard deviation.
   */
  sigma: number | null;
  /**
   * Vertices without temperature.
   */
  missing_count: number;
  /**
   * Vertices hotter than the sensor could tell; in no other fact.
   */
  over_range_count: number;
  /**
   * Vertices colder than the sensor could tell.
   */
  under_range_count: number;
}
/**
 * When parts of the scene were seen, Unix seconds; of the parts of which that is known.
 */
export interface SceneObserved {
  oldest: number | null;
  newest: number | null;
}
/**
 * Absent in a scene that does not remember, as a file.
 */
export interface SceneBaseline {
  /**
   * When the baseline was marked, Unix seconds; null = never: each vertex is compared with what it was when first seen.
   */
  marked_at: number | null;
}
/**
 * Something that was repaired, left out or interpreted while the scene was read.
 */
export interface SceneNote {
  /**
   * snake_case, stable.
   */
  id: string;
  count: number;
  /**
   * One sentence for a person, with the count.
   */
  message: string;
}
/**
 * QUALITY: the knobs in force.
 */
export interface QualityState {
  mode: QualityMode;
  /**
   * Lattice step; the largest error per axis is half of it.
   */
  position_step_mm: number;
  colour_bits: number;
  /**
   * Largest error on the screen, pixels.
   */
  pixel_error: number;
  /**
   * Draco speed: 0 smallest, 10 fastest.
   */
  encoder_speed: number;
  /**
   * Aim of mode auto.
   */
  latency_target_ms: number;
  /**
   * Colours carry which vertices the method highlights.
   */
  marks: boolean;
}
/**
 * Result of scene.histogram; without thermal data every list is empty, mean and sigma are null.
 */
export interface HistogramReply {
  /**
   * bins + 1 temperatures, degC.
   */
  edges: number[];
  /**
   * Vertices per bin.
   */
  counts: number[];
  mean: number | null;
  sigma: number | null;
  /**
   * Intervals [low, high] that the current method highlights, degC.
   */
  highlighted: [number, number][];
  /**
   * Share of the surface (of points: of the vertices) that the current method highlights; absent for a method that shows all temperatures alike.
   */
  highlighted_share?: number;
}
/**
 * Params of scene.histogram.
 */
export interface HistogramRequest {
  bins: number;
}
/**
 * Params of the notification ingest.acknowledged: the change is part of the map, and durable where there is a store.
 */
export interface IngestAcknowledged {
  /**
   * Of the message.
   */
  sequence: number;
  /**
   * Of the block; of the change, when one was taken out.
   */
  revision: number;
  /**
   * What was noticed in the block; left out when there is nothing.
   */
  notes?: SceneNote[];
  credit: IngestCredit;
}
/**
 * What may have been sent since the connection began; only ever grows.
 */
export interface IngestCredit {
  /**
   * Messages.
   */
  blocks: number;
  /**
   * Of messages; the last one may go beyond it.
   */
  bytes: number;
}
/**
 * Params of the notification ingest.hello.
 */
export interface IngestHello {
  /**
   * spectra.ingest.v1
   */
  protocol: string;
  limits: IngestLimits;
  credit: IngestCredit;
}
/**
 * What one message may hold.
 */
export interface IngestLimits {
  /**
   * PLY.
   */
  max_block_bytes: number;
  /**
   * Name and query.
   */
  max_target_bytes: number;
}
/**
 * Params of the notification ingest.refused: the map is as it was.
 */
export interface IngestRefused {
  /**
   * Of the message.
   */
  sequence: number;
  /**
   * snake_case, stable.
   */
  code: string;
  /**
   * What is wrong; may be empty.
   */
  field: string;
  /**
   * One sentence for a person.
   */
  reason: string;
  /**
   * What would be accepted, for a person; left out when there is nothing to say.
   */
  limits?: string;
  credit: IngestCredit;
}
/**
 * Result of scene.probe: the nearest vertex at full accuracy.
 */
export interface ProbeReply {
  /**
   * In the input's order.
   */
  vertex_index: number;
  position: Vector3;
  /**
   * degC; null = missing, or beyond the sensor's range.
   */
  temperature: number | null;
  /**
   * The reading is beyond the sensor's range, hotter or colder than it could tell; absent otherwise.
   */
  temperature_range?: "over" | "under";
  visible: ColourBytes;
  fused: ColourBytes;
  /**
   * Metres.
   */
  distance: number;
  /**
   * When the vertex was seen, Unix seconds; null = not known.
   */
  observed_at?: number | null;
  /**
   * What its temperature is compared with, degC; null = nothing, or beyond the sensor's range.
   */
  baseline?: number | null;
  /**
   * The time that is of, Unix seconds; null = not known.
   */
  baseline_at?: number | null;
  /**
   * Standard deviation of the temperature, kelvin, apart from the camera's absolute error; absent where nobody says how sure it is.
   */
  temperature_sigma?: number;
  /**
   * When the thermal camera last looked there, Unix seconds; absent where it is not known.
   */
  temperature_at?: number;
}
/**
 * Params of scene.probe.
 */
export interface ProbeRequest {
  position: Vector3;
}
/**
 * Params of quality.set; what is absent stays.
 */
export interface QualityChange {
  mode?: QualityMode;
  position_step_mm?: number;
  colour_bits?: number;
  pixel_error?: number;
  encoder_speed?: number;
  latency_target_ms?: number;
  marks?: boolean;
}
/**
 * Result of quality.set.
 */
export interface QualityReply {
  quality: QualityState;
}
/**
 * Tiles that the client still has, with colours, from an earlier connection.
 */
export interface ResumeRequest {
  /**
   * Of the hello of that connection.
   */
  session_id: string;
  /**
   * [level (0..255), x, y, z, revision (from 1)] of each.
   */
  tiles: number[][];
  /**
   * Places in tiles of those of which it has both raw layers, in the form that it asks for now; absent: none.
   */
  raw?: number[];
}
/**
 * Params of the notification robot.moved.
 */
export interface RobotMoved {
  /**
   * Unix seconds.
   */
  at: number;
  position: Vector33;
  forward: Vector34;
  up: Vector35;
  /**
   * True: it does not know where it is, and this is where it was last.
   */
  lost?: boolean;
  path: RobotPath;
}
/**
 * A part of the way the robot has come.
 */
export interface RobotPath {
  /**
   * What the client has of the way from this point on is replaced.
   */
  first: number;
  /**
   * Metres, in the coordinates of the map.
   */
  points: Vector3[];
}
/**
 * A refusal; a refused request changes nothing.
 */
export interface RpcError {
  /**
   * -32700 parse, -32600 request, -32601 method, -32602 params, -32603 internal, -32001 unauthorised, -32002 forbidden, -32003 busy, -32004 no scene.
   */
  code: number;
  message: string;
  data: RpcErrorData;
}
/**
 * What was wrong and what would be accepted.
 */
export interface RpcErrorData {
  /**
   * Path such as params.alpha; empty: the message itself.
   */
  field: string;
  reason: string;
  limits?: string;
}
/**
 * Server to client.
 */
export interface RpcFailure {
  jsonrpc: "2.0";
  /**
   * null: the message had no usable id.
   */
  id: number | string | null;
  error: RpcError;
}
/**
 * Either direction; never answered, except that one which cannot be carried out is reported by RpcFailure with id null.
 */
export interface RpcNotification {
  jsonrpc: "2.0";
  method: string;
  params?: {};
}
/**
 * Client to server; answered by RpcResult or RpcFailure of the same id.
 */
export interface RpcRequest {
  jsonrpc: "2.0";
  id: RpcId;
  method: string;
  params?: {};
}
/**
 * Server to client.
 */
export interface RpcResult {
  jsonrpc: "2.0";
  id: RpcId;
  result: {};
}
/**
 * What temperatures are compared with.
 */
export interface SceneBaseline1 {
  /**
   * When the baseline was marked, Unix seconds; null = never: each vertex is compared with what it was when first seen.
   */
  marked_at: number | null;
}
/**
 * Params of the notification scene.changed.
 */
export interface SceneChanged {
  scene: SceneDescription;
}
/**
 * Params of the notification status; the same id replaces, message null clears.
 */
export interface Status {
  id: string;
  level: StatusLevel;
  message: string | null;
}
/**
 * What is on the screen now.
 */
export interface StreamAccuracy {
  /**
   * Largest error per axis.
   */
  position_mm: number | null;
  /**
   * Levels of a colour channel that can be told apart; coarse tiles count.
   */
  colour_levels: number;
  pixel_error: number | null;
  /**
   * Of temperatures, for 95 % of the surface; null: there are none.
   */
  temperature_celsius: number | null;
}
/**
 * Params of the notification stream.ack.
 */
export interface StreamAck {
  /**
   * Every frame up to this one is decoded.
   */
  sequence: number;
}
/**
 * Params of the notification stream.complete: all that camera and quality ask for has been sent.
 */
export interface StreamComplete {
  generation: number;
  scene_revision: number;
  tiles: number;
  vertices: number;
}
/**
 * Params of the notification stream.stats.
 */
export interface StreamStats {
  /**
   * null: not measured yet.
   */
  round_trip_ms: number | null;
  /**
   * null: not measured yet.
   */
  throughput_bytes_per_s: number | null;
  queued_bytes: number;
  /**
   * Superseded before they were sent.
   */
  skipped_frames: number;
  /**
   * Connected now.
   */
  viewers: number;
  accuracy: StreamAccuracy;
}
/**
 * Result of scene.subscribe.
 */
export interface SubscribeReply {
  /**
   * There when the request had resume: how many of the claimed tiles are current and are not sent again.
   */
  resumed_tiles?: number;
}
/**
 * Params of scene.subscribe.
 */
export interface SubscribeRequest {
  /**
   * @minItems 1
   */
  channels: [Channel, ...Channel[]];
  /**
   * Most frame bytes beyond the last stream.ack; absent: the server's choice.
   */
  in_flight_bytes?: number;
  /**
   * Most bytes of decoded tiles held by the client (16 a vertex, 12 a triangle); absent: no bound to what it asks for.
   */
  cache_bytes?: number;
  /**
   * How colours are written: none = frames of kind 2 (r, g, b), subtract_green = kind 6 (g and r - g, b - g).
   */
  colour_transform?: "none" | "subtract_green";
  /**
   * Step of the channel temperature; absent: the larger of 0.01 degC and a 65,000th of the tile's span.
   */
  temperature_step_celsius?: number;
  resume?: ResumeRequest1;
}
/**
 * Tiles that the client still has, with colours, from an earlier connection.
 */
export interface ResumeRequest1 {
  /**
   * Of the hello of that connection.
   */
  session_id: string;
  /**
   * [level (0..255), x, y, z, revision (from 1)] of each.
   */
  tiles: number[][];
  /**
   * Places in tiles of those of which it has both raw layers, in the form that it asks for now; absent: none.
   */
  raw?: number[];
}
