// Compares meshes as multisets of triangles, whatever the order of vertices and triangles: each triangle is hashed from
// its corners' lattice points and colours, in their cyclic order, and the hashes are summed. Two different random-like
// sums over all triangles agree by chance with probability around 2^-53.

function mixed(a, b) {
  let h = Math.imul(a ^ (b >>> 15), 0x2c1b3c6d) ^ Math.imul(b + 0x9e3779b9, 0x297a2d39);
  h ^= h >>> 12;
  h = Math.imul(h, 0x297a2d39);
  return (h ^ (h >>> 15)) >>> 0;
}

/** Collects triangles (or points) whose corners are given as hashes. */
export class MeshIdentity {
  first = 0;
  second = 0;
  count = 0;

  addTriangle(a, b, c) {
    this.first += mixed(mixed(a, b) + mixed(b, c) + mixed(c, a), 17);
    this.second += mixed(mixed(a, c) ^ mixed(b, a) ^ mixed(c, b), 91);
    this.count += 1;
  }

  addPoint(a) {
    this.first += mixed(a, 17);
    this.second += mixed(a, 91);
    this.count += 1;
  }

  toString() {
    return `${this.count} pieces, ${this.first}, ${this.second}`;
  }
}

export function cornerHash(lattice, colour) {
  return mixed(
    mixed(mixed(lattice[0], lattice[1]), lattice[2]),
    (colour[0] << 16) | (colour[1] << 8) | colour[2],
  );
}

/** The lattice point nearest to a coordinate, half up, as every position on the wire is rounded. */
export const nearestLattice = (value, step) => Math.floor(value / step + 0.5);

/** Identity of a file's mesh on the lattice of `step`, with the file's colours. */
export function identityOfPly(ply, origin, step) {
  const hashes = new Uint32Array(ply.vertexCount);
  for (let i = 0; i < ply.vertexCount; ++i) {
    hashes[i] = cornerHash(
      [
        nearestLattice(ply.x[i] - origin[0], step),
        nearestLattice(ply.y[i] - origin[1], step),
        nearestLattice(ply.z[i] - origin[2], step),
      ],
      [ply.red[i], ply.green[i], ply.blue[i]],
    );
  }
  return identityOfCorners(hashes, ply.triangles);
}

/** Identity of what a client holds, positions as it decodes them. */
export function identityOfTiles(tiles) {
  const bits = new Int32Array(1);
  const metres = new Float32Array(bits.buffer);
  return identityOfHashedTiles(tiles, (place, colour) => {
    const hashed = place.map((value) => {
      metres[0] = value;
      return bits[0];
    });
    return cornerHash(hashed, colour);
  });
}

/** Identity of a file's triangles by nothing but the colours of their corners. */
export function colourIdentityOfPly(ply) {
  const hashes = new Uint32Array(ply.vertexCount);
  for (let i = 0; i < ply.vertexCount; ++i) hashes[i] = cornerHash([0, 0, 0], [ply.red[i], ply.green[i], ply.blue[i]]);
  return identityOfCorners(hashes, ply.triangles);
}

/** The same of what a client holds. */
export const colourIdentityOfTiles = (tiles) =>
  identityOfHashedTiles(tiles, (_, colour) => cornerHash([0, 0, 0], colour));

const placeOf = ({ frame, geometry }, v) => [0, 1, 2].map((axis) => geometry.positions[3 * v + axis] + frame.origin[axis]);

function identityOfHashedTiles(tiles, hashOf) {
  const identity = new MeshIdentity();
  for (const tile of tiles) {
    const hashes = new Uint32Array(tile.geometry.positions.length / 3);
    for (let v = 0; v < hashes.length; ++v) hashes[v] = hashOf(placeOf(tile, v), tile.colours.subarray(3 * v, 3 * v + 3));
    const part = identityOfCorners(hashes, tile.geometry.indices);
    identity.first += part.first;
    identity.second += part.second;
    identity.count += part.count;
  }
  return identity;
}

/** Decoded vertices that no vertex of the file with their colour is near to: half a step of their tile along each axis. */
export function misplacedVertices(tiles, ply, origin) {
  const cell = Math.max(...tiles.map(({ frame }) => frame.step));
  const slots = 1 << 21;
  const slotOf = (x, y, z) => mixed(mixed(x | 0, y | 0), z | 0) & (slots - 1);
  const cellOf = (value) => Math.floor(value / cell);
  const first = new Int32Array(slots).fill(-1);
  const next = new Int32Array(ply.vertexCount);
  for (let i = 0; i < ply.vertexCount; ++i) {
    const slot = slotOf(cellOf(ply.x[i] - origin[0]), cellOf(ply.y[i] - origin[1]), cellOf(ply.z[i] - origin[2]));
    next[i] = first[slot];
    first[slot] = i;
  }
  const misplaced = [];
  for (const tile of tiles) {
    const reach = tile.frame.step * 0.500001;
    const { positions } = tile.geometry;
    for (let v = 0; v < positions.length / 3; ++v) {
      const px = positions[3 * v] + tile.frame.origin[0];
      const py = positions[3 * v + 1] + tile.frame.origin[1];
      const pz = positions[3 * v + 2] + tile.frame.origin[2];
      const isNear = (i) =>
        Math.abs(ply.x[i] - origin[0] - px) <= reach &&
        Math.abs(ply.y[i] - origin[1] - py) <= reach &&
        Math.abs(ply.z[i] - origin[2] - pz) <= reach &&
        ply.red[i] === tile.colours[3 * v] &&
        ply.green[i] === tile.colours[3 * v + 1] &&
        ply.blue[i] === tile.colours[3 * v + 2];
      const [highX, highY, highZ] = [cellOf(px + reach), cellOf(py + reach), cellOf(pz + reach)];
      let isFound = false;
      for (let x = cellOf(px - reach); x <= highX && !isFound; ++x) {
        for (let y = cellOf(py - reach); y <= highY && !isFound; ++y) {
          for (let z = cellOf(pz - reach); z <= highZ && !isFound; ++z) {
            for (let i = first[slotOf(x, y, z)]; i >= 0 && !isFound; i = next[i]) isFound = isNear(i);
          }
        }
      }
      if (!isFound) misplaced.push(`${tile.frame.tile}: ${px}, ${py}, ${pz}`);
    }
  }
  return misplaced;
}

function identityOfCorners(hashes, indices) {
  const identity = new MeshIdentity();
  if (indices.length === 0) for (const hash of hashes) identity.addPoint(hash);
  for (let i = 0; i < indices.length; i += 3) {
    identity.addTriangle(hashes[indices[i]], hashes[indices[i + 1]], hashes[indices[i + 2]]);
  }
  return identity;
}
