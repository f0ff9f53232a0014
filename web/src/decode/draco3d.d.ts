/** The part of the Draco JavaScript decoder that is used; the package brings no types of its own. */
declare module 'draco3d/draco_decoder_nodejs.js' {
  export interface Status {
    ok(): boolean;
    error_msg(): string;
  }
  export interface Attribute {
    num_components(): number;
    attribute_type(): number;
  }
  export interface PointCloud {
    num_points(): number;
    num_attributes(): number;
  }
  export interface Mesh extends PointCloud {
    num_faces(): number;
  }
  export interface Decoder {
    GetEncodedGeometryType(bytes: Int8Array): number;
    DecodeArrayToMesh(bytes: Int8Array, size_bytes: number, mesh: Mesh): Status;
    DecodeArrayToPointCloud(bytes: Int8Array, size_bytes: number, cloud: PointCloud): Status;
    GetAttributeId(geometry: PointCloud, type: number): number;
    GetAttribute(geometry: PointCloud, attribute_id: number): Attribute;
    GetAttributeDataArrayForAllPoints(
      geometry: PointCloud,
      attribute: Attribute,
      data_type: number,
      size_bytes: number,
      address: number,
    ): boolean;
    GetTrianglesUInt32Array(mesh: Mesh, size_bytes: number, address: number): boolean;
  }
  export interface DecoderModule {
    Decoder: new () => Decoder;
    Mesh: new () => Mesh;
    PointCloud: new () => PointCloud;
    TRIANGULAR_MESH: number;
    POINT_CLOUD: number;
    POSITION: number;
    COLOR: number;
    GENERIC: number;
    DT_FLOAT32: number;
    DT_UINT8: number;
    DT_UINT16: number;
    HEAPF32: Float32Array<ArrayBuffer>;
    _malloc(size_bytes: number): number;
    _free(address: number): void;
    destroy(object: unknown): void;
  }
  export default function createDecoderModule(options: { wasmBinary?: ArrayBuffer }): Promise<DecoderModule>;
}
