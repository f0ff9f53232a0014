// A scene as a mapper would have sent it: blocks of some thousand vertices beside each other, which share the vertices of their borders.

/** Cuts a scene, as readPly() gives it, into blocks of at most `most` vertices, borders apart. Each is a PLY file; `warmer(kelvin)` is the same with other temperatures. */
export function cutScene(scene, most) {
  const { x, y, z, vertexCount, triangles } = scene;
  const block_of = new Int32Array(vertexCount);
  const parts = [Uint32Array.from({ length: vertexCount }, (_, vertex) => vertex)];
  let count = 0;
  while (parts.length > 0) {
    const part = parts.pop();
    if (part.length <= most) {
      for (const vertex of part) block_of[vertex] = count;
      count += 1;
      continue;
    }
    const extents = [x, y, z].map((axis) => {
      let [low, high] = [Infinity, -Infinity];
      for (const vertex of part) [low, high] = [Math.min(low, axis[vertex]), Math.max(high, axis[vertex])];
      return high - low;
    });
    const axis = [x, y, z][extents.indexOf(Math.max(...extents))];
    part.sort((a, b) => axis[a] - axis[b]);
    parts.push(part.subarray(0, part.length >> 1), part.subarray(part.length >> 1));
  }
  const faces = Array.from({ length: count }, () => []);
  for (let i = 0; i < triangles.length; i += 3) faces[block_of[triangles[i]]].push(i);
  return faces.map((own) => {
    const index_of = new Map();
    const vertices = [];
    for (const first of own) {
      for (let corner = 0; corner < 3; corner += 1) {
        const vertex = triangles[first + corner];
        if (index_of.has(vertex)) continue;
        index_of.set(vertex, vertices.length);
        vertices.push(vertex);
      }
    }
    const middle = [x, y, z].map((axis) => vertices.reduce((sum, vertex) => sum + axis[vertex], 0) / vertices.length);
    return { vertex_count: vertices.length, middle, warmer: (kelvin) => plyOf(scene, vertices, own, index_of, kelvin) };
  });
}

function plyOf({ x, y, z, red, green, blue, temperature, triangles }, vertices, faces, index_of, kelvin) {
  const header =
    `ply\nformat binary_little_endian 1.0\nelement vertex ${vertices.length}\nproperty float x\nproperty float y\nproperty float z\n` +
    `property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float temperature\nelement face ${faces.length}\n` +
    "property list uchar int vertex_indices\nend_header\n";
  const body = Buffer.alloc(vertices.length * 19 + faces.length * 13);
  let at = 0;
  for (const vertex of vertices) {
    for (const axis of [x, y, z]) at = body.writeFloatLE(axis[vertex], at);
    for (const channel of [red, green, blue]) at = body.writeUInt8(channel[vertex], at);
    at = body.writeFloatLE(temperature[vertex] + kelvin, at);
  }
  for (const first of faces) {
    at = body.writeUInt8(3, at);
    for (let corner = 0; corner < 3; corner += 1) at = body.writeInt32LE(index_of.get(triangles[first + corner]), at);
  }
  return Buffer.concat([Buffer.from(header), body]);
}
