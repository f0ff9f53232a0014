// Reads the binary little-endian PLY files that Spectra writes and the real scenes have: scalar vertex properties and one
// triangle list, by a reader of the tests' own, so that the program's is not tested with itself; and writes a small scene.
import { readFileSync } from "node:fs";

const SIZES = { char: 1, uchar: 1, short: 2, ushort: 2, int: 4, uint: 4, float: 4, double: 8, uint8: 1, int32: 4, float32: 4, float64: 8 };

export function readPly(path) {
  const data = readFileSync(path);
  const end = data.indexOf("end_header\n") + "end_header\n".length;
  const header = data.subarray(0, end).toString("latin1").split("\n");
  const elements = [];
  for (const line of header) {
    const words = line.split(/\s+/);
    if (words[0] === "element") elements.push({ name: words[1], count: Number(words[2]), properties: [] });
    if (words[0] === "property") elements.at(-1).properties.push({ type: words[1], name: words.at(-1), words });
  }
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const read = { 1: (o) => view.getUint8(o), 4: (o) => view.getFloat32(o, true), 8: (o) => view.getFloat64(o, true) };
  const vertex = elements.find((element) => element.name === "vertex");
  let stride = 0;
  const offsets = {};
  for (const property of vertex.properties) {
    offsets[property.name] = { at: stride, size: SIZES[property.type] };
    stride += SIZES[property.type];
  }
  const column = (name, ArrayType) => {
    if (!offsets[name]) return null;
    const { at, size } = offsets[name];
    const values = new ArrayType(vertex.count);
    for (let i = 0; i < vertex.count; ++i) values[i] = read[size](end + i * stride + at);
    return values;
  };
  const face = elements.find((element) => element.name === "face");
  const triangles = new Uint32Array(3 * (face?.count ?? 0));
  let offset = end + vertex.count * stride;
  for (let i = 0; i < (face?.count ?? 0); ++i) {
    if (view.getUint8(offset) !== 3) throw new Error(`${path}: face ${i} is no triangle`);
    for (let corner = 0; corner < 3; ++corner) triangles[3 * i + corner] = view.getUint32(offset + 1 + 4 * corner, true);
    offset += 13;
  }
  if (offset !== data.byteLength) throw new Error(`${path}: ${data.byteLength - offset} bytes too many`);
  return {
    vertexCount: vertex.count,
    x: column("x", Float64Array),
    y: column("y", Float64Array),
    z: column("z", Float64Array),
    red: column("red", Uint8Array),
    green: column("green", Uint8Array),
    blue: column("blue", Uint8Array),
    temperature: column("temperature", Float32Array),
    sigma: column("temperature_sigma", Float32Array),
    seen: column("seen", Float64Array),
    triangles,
  };
}

/** A sheet of 60 x 60 vertices; `celsiusAt` tells the temperature of the one at x, y, as it is to be written. */
export function sheet(celsiusAt) {
  const side = 60;
  const vertices = [];
  const faces = [];
  for (let x = 0; x < side; ++x) {
    for (let y = 0; y < side; ++y) {
      vertices.push(`${x * 0.05} ${y * 0.05} 0 90 ${4 * x} ${4 * y} ${celsiusAt(x, y)}`);
      const v = x * side + y;
      if (x > 0 && y > 0) faces.push(`3 ${v - side - 1} ${v - 1} ${v}`, `3 ${v - side - 1} ${v} ${v - side}`);
    }
  }
  const properties = ["x", "y", "z"].map((name) => `property float ${name}\n`).join("");
  const colours = ["red", "green", "blue"].map((name) => `property uchar ${name}\n`).join("");
  return (
    `ply\nformat ascii 1.0\nelement vertex ${vertices.length}\n${properties}${colours}property float temperature\n` +
    `element face ${faces.length}\nproperty list uchar int vertex_indices\nend_header\n${vertices.join("\n")}\n${faces.join("\n")}\n`
  );
}
