/** What the page and its decode workers say to each other. */

export interface GeometryJob {
  kind: 'geometry';
  payload: Uint8Array<ArrayBuffer>;
  origin_m: [number, number, number];
}
export interface ColoursJob {
  kind: 'colours';
  payload: Uint8Array<ArrayBuffer>;
  /** How the payload writes colours, see docs/protocol.md. */
  transform: 'none' | 'subtract_green';
}
/** A raw layer: what the sensors saw, for whoever fuses by himself. */
export interface VisibleJob {
  kind: 'visible';
  payload: Uint8Array<ArrayBuffer>;
  transform: 'none' | 'subtract_green';
}
export interface TemperatureJob {
  kind: 'temperature';
  payload: Uint8Array<ArrayBuffer>;
}
/** How sure its temperatures are. */
export interface SigmaJob {
  kind: 'sigma';
  payload: Uint8Array<ArrayBuffer>;
}
export type DecodeJob = GeometryJob | ColoursJob | VisibleJob | TemperatureJob | SigmaJob;

/** What the page keeps of a geometry, whose arrays go on to where they are drawn. */
export interface GeometrySummary {
  vertex_count: number;
  /** 0 in a point cloud. */
  triangle_count: number;
  centre: [number, number, number];
  radius: number;
  /** Some of the vertices that are drawn, evenly spread: x, y, z each. */
  sample: Float32Array<ArrayBuffer>;
  /** Distance between neighbouring points of a cloud, metres; 0 where there is surface, and where there is one place only. */
  point_spacing: number;
  /** Sum of the triangles' normals, each as long as twice the triangle's area, and the sum of those lengths. */
  normal_sum: [number, number, number];
  area_sum: number;
}
export interface DecodedGeometry {
  kind: 'geometry';
  /** Metres relative to the scene origin. */
  positions: Float32Array<ArrayBuffer>;
  /** Null: a point cloud. */
  indices: Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer> | null;
  summary: GeometrySummary;
}
export interface DecodedColours {
  kind: 'colours';
  /** Red, green, blue, alpha per vertex: sRGB bytes as they go to the screen; alpha 0 where the vertex is marked as highlighted, else 255. */
  rgba: Uint8Array<ArrayBuffer>;
}
export interface DecodedVisible {
  kind: 'visible';
  /** Red, green, blue per vertex. */
  rgb: Uint8Array<ArrayBuffer>;
}
export interface DecodedTemperature {
  kind: 'temperature';
  /** degC = code * scale + offset, see celsiusOf; the last three codes stand for what has no number. */
  codes: Uint16Array<ArrayBuffer>;
  scale: number;
  offset: number;
}
export interface DecodedSigma {
  kind: 'sigma';
  /** Kelvin, as temperatures are written. */
  codes: Uint16Array<ArrayBuffer>;
  scale: number;
  offset: number;
}
export type DecodeResult = DecodedGeometry | DecodedColours | DecodedVisible | DecodedTemperature | DecodedSigma;

export interface WorkerRequest {
  id: number;
  job: DecodeJob;
}
export type WorkerReply = { id: number; result: DecodeResult } | { id: number; error: string };
