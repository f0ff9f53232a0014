/**
 * A bumpy patch of side x side vertices as a PLY file, by default a metre apart: patches beside each other share the vertices of
 * their borders. `sigma`: how sure the temperatures are, kelvin, and `seen` when they were looked at. `at` is where its corner of column 0 and row 0 stands, `scale` the distance of neighbours.
 */
export function patch(column, row, { side = 101, celsius = 20, height = 0, scale = 1, at: origin = [0, 0, 0], sigma, seen = 1.7e9 } = {}) {
  const entry = sigma === undefined ? 19 : 31;
  const count = side * side;
  const faces = (side - 1) * (side - 1) * 2;
  const header =
    `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\nproperty float x\nproperty float y\nproperty float z\n` +
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float temperature\n" +
    (sigma === undefined ? "" : "property float temperature_sigma\nproperty double seen\n") +
    `element face ${faces}\nproperty list uchar int vertex_indices\nend_header\n`;
  const body = Buffer.alloc(count * entry + faces * 13);
  let at = 0;
  for (let v = 0; v < count; v += 1) {
    const x = column * (side - 1) + (v % side);
    const y = row * (side - 1) + Math.floor(v / side);
    const place = [x, y, height + Math.sin(x / 7) * Math.cos(y / 9)].map((value, axis) => origin[axis] + scale * value);
    for (const value of place) at = body.writeFloatLE(value, at);
    for (const value of [v % 256, 90, 120]) at = body.writeUInt8(value, at);
    at = body.writeFloatLE(celsius + Math.sin(v), at);
    if (sigma === undefined) continue;
    at = body.writeFloatLE(sigma, at);
    at = body.writeDoubleLE(seen, at);
  }
  for (let r = 0; r + 1 < side; r += 1) {
    for (let c = 0; c + 1 < side; c += 1) {
      const a = r * side + c;
      for (const corners of [
        [a, a + 1, a + side],
        [a + 1, a + side + 1, a + side],
      ]) {
        at = body.writeUInt8(3, at);
        for (const corner of corners) at = body.writeInt32LE(corner, at);
      }
    }
  }
  return Buffer.concat([Buffer.from(header), body]);
}
