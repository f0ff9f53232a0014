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

/** Identity of what a client holds; checks that every decoded coordinate is a lattice point. */
export function identityOfTiles(tiles) {
  const identity = new MeshIdentity();
  for (const { frame, geometry, colours } of tiles) {
    const count = geometry.positions.length / 3;
    const hashes = new Uint32Array(count);
    for (let i = 0; i < count; ++i) {
      const lattice = [0, 1, 2].map((axis) => {
        const metres = geometry.positions[3 * i + axis] + frame.origin[axis];
        const index = Math.round(metres / frame.step);
        if (index * frame.step !== metres) throw new Error(`${frame.tile}: vertex ${i} lies off the lattice`);
        return index;
      });
      hashes[i] = cornerHash(lattice, colours.subarray(3 * i, 3 * i + 3));
    }
    const part = identityOfCorners(hashes, geometry.indices);
    identity.first += part.first;
    identity.second += part.second;
    identity.count += part.count;
  }
  return identity;
}

function identityOfCorners(hashes, indices) {
  const identity = new MeshIdentity();
  if (indices.length === 0) for (const hash of hashes) identity.addPoint(hash);
  for (let i = 0; i < indices.length; i += 3) {
    identity.addTriangle(hashes[indices[i]], hashes[indices[i + 1]], hashes[indices[i + 2]]);
  }
  return identity;
}
