// The files that Spectra writes, opened by programs that are not ours: three.js' loaders, the glTF validator of Khronos,
// Debian's assimp and draco_decoder. They see the positions, colours, temperatures and triangles that went in.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import validator from "gltf-validator";
import { MeshIdentity, cornerHash, identityOfPly, nearestLattice } from "./mesh_identity.mjs";
import { readPly } from "./ply.mjs";
import { binary, run } from "./spectra_server.mjs";
import { serveDecoder } from "./three_in_node.mjs";
import { DRACOLoader } from "three/examples/jsm/loaders/DRACOLoader.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-exports-"));
const decoder = await serveDecoder();
after(() => {
  decoder.stop();
  rmSync(folder, { recursive: true });
});
const inFolder = (name) => path.join(folder, name);
const arrayBufferOf = (file) => {
  const { buffer, byteOffset, byteLength } = readFileSync(file);
  return buffer.slice(byteOffset, byteOffset + byteLength);
};

const scene = inFolder("scene.ply");
run("demo-scene", scene, "--vertices", "20000");
/** Writes the fused scene as a file of that ending and returns its name and what was said of it. */
function fused(ending, input = scene, ...options) {
  const output = inFolder(`fused-${path.basename(input, ".ply")}${options.join("")}.${ending}`);
  const args = ["fuse", input, output, "--method", "thermal_visible_blend", ...options];
  const { status, stderr } = spawnSync(binary, args, { encoding: "utf8" });
  assert.equal(status, 0, stderr);
  return { output, said: stderr };
}
const picture = readPly(fused("ply").output);

/** A small scene as text. */
function written(name, { header, vertices, triangles = [] }) {
  const lines = ["ply", "format ascii 1.0", `element vertex ${vertices.length}`, ...header.map((line) => `property ${line}`)];
  if (triangles.length > 0) lines.push(`element face ${triangles.length}`, "property list uchar int vertex_indices");
  lines.push("end_header", ...vertices.map((row) => row.join(" ")), ...triangles.map((row) => `3 ${row.join(" ")}`), "");
  writeFileSync(inFolder(name), lines.join("\n"));
  return inFolder(name);
}
const kFloats = ["float x", "float y", "float z"];
const kColours = ["uchar red", "uchar green", "uchar blue"];
const oneColour = written("one_colour.ply", {
  header: [...kFloats, ...kColours, "float temperature"],
  vertices: [[0, 0, 0, 60, 100, 80, 20], [1, 0, 0, 60, 100, 80, 21], [0, 1, 0.5, 60, 100, 80, "nan"]],
  triangles: [[0, 1, 2]],
});

/** The byte that a screen is given for a linear value. */
function screenByte(linear) {
  return Math.round(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));
}
const screenColours = (attribute) =>
  Array.from({ length: attribute.count }, (_, i) => [attribute.getX(i), attribute.getY(i), attribute.getZ(i)].map(screenByte));
const coloursOf = (ply) => Array.from({ length: ply.vertexCount }, (_, i) => [ply.red[i], ply.green[i], ply.blue[i]]);
const missingAs = (value) => (celsius) => (Number.isNaN(celsius) ? value : celsius);

function loadedGlb(file) {
  return new Promise((resolve, reject) => new GLTFLoader().parse(arrayBufferOf(file), "", resolve, reject));
}

async function loadedDraco(file) {
  const loader = new DRACOLoader().setDecoderPath(decoder.url).setDecoderConfig({ type: "js" });
  try {
    return await new Promise((resolve, reject) => {
      const ids = { position: 0, color: 1, temperature: 2 };
      const types = { position: "Float32Array", color: "Float32Array", temperature: "Float32Array" };
      loader.decodeDracoFile(arrayBufferOf(file), resolve, ids, types, "srgb", reject);
    });
  } finally {
    loader.dispose();
  }
}

/** A vertex with +Y up: z is up unless the scene says that y is. */
const isYUp = /^comment up y\b/m.test(readFileSync(scene).subarray(0, 1000).toString("latin1"));
const uprightOf = (ply, i) => (isYUp ? [ply.x[i], ply.y[i], ply.z[i]] : [ply.x[i], ply.z[i], -ply.y[i]]);

test("three.js reads the PLY", () => {
  const loader = new PLYLoader();
  loader.setCustomPropertyNameMapping({ temperature: ["temperature"] });
  const { attributes, index } = loader.parse(arrayBufferOf(fused("ply").output));
  for (const [axis, get] of [["x", "getX"], ["y", "getY"], ["z", "getZ"]]) {
    for (let i = 0; i < picture.vertexCount; ++i) assert.equal(attributes.position[get](i), picture[axis][i]);
  }
  assert.deepEqual(screenColours(attributes.color), coloursOf(picture));
  assert.deepEqual(attributes.temperature.array, picture.temperature);
  assert.deepEqual(Uint32Array.from(index.array), picture.triangles);
});

test("three.js reads the GLB, upright and in its colours", async () => {
  const gltf = await loadedGlb(fused("glb", scene).output);
  let mesh;
  gltf.scene.traverse((object) => {
    if (object.isMesh) mesh = object;
  });
  const { position, color, _temperature } = mesh.geometry.attributes;
  assert.equal(position.count, picture.vertexCount);
  gltf.scene.updateMatrixWorld();
  for (let i = 0; i < position.count; ++i) {
    assert.deepEqual([position.getX(i), position.getY(i), position.getZ(i)], uprightOf(picture, i));
  }
  assert.deepEqual(screenColours(color), coloursOf(picture));
  assert.ok(mesh.material.isMeshBasicMaterial && mesh.material.vertexColors, "unlit, in the colours of the vertices");
  assert.deepEqual(_temperature.array, picture.temperature.map(missingAs(-1000)));
  assert.deepEqual(Uint32Array.from(mesh.geometry.index.array), picture.triangles);
});

test("a colour is the same on the screen as PLY, GLB and Draco", async () => {
  const options = ["--method", "visible_only"];
  const files = Object.fromEntries(["ply", "glb", "drc"].map((ending) => {
    const output = inFolder(`colour.${ending}`);
    run("fuse", oneColour, output, ...options);
    return [ending, output];
  }));
  const gltf = await loadedGlb(files.glb);
  const attributes = [
    new PLYLoader().parse(arrayBufferOf(files.ply)).attributes.color,
    gltf.scene.getObjectByProperty("isMesh", true).geometry.attributes.color,
    (await loadedDraco(files.drc)).attributes.color,
  ];
  for (const attribute of attributes) assert.deepEqual(screenColours(attribute), Array(3).fill([60, 100, 80]));
});

test("Khronos' validator has nothing to say about a GLB", async () => {
  const vertices = [[500000.25, 4000000.5, 12.125], [500001.25, 4000000.5, 12.125], [500000.25, 4000001.5, 13]];
  const inputs = [
    scene,
    oneColour,
    written("cloud.ply", { header: kFloats, vertices: [[0, 0, 0], [1, 2, 3]] }),
    written("far.ply", { header: ["double x", "double y", "double z"], vertices, triangles: [[0, 1, 2]] }),
    written("hot.ply", {
      header: [...kFloats, "float temperature"],
      vertices: [[0, 0, 0, 20], [1, 0, 0, "inf"], [0, 1, 0, 21]],
      triangles: [[0, 1, 2]],
    }),
  ];
  for (const input of inputs) {
    const { output } = fused("glb", input);
    const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(output)));
    assert.deepEqual(issues.messages, [], input);
    assert.equal(issues.truncated, false);
  }
});

test("three.js reads the Draco file: every triangle once, where the one in the scene's order has it", async () => {
  const { output, said } = fused("drc");
  assert.match(said, /rounded to .* mm, finer where the form is finer, temperatures to .* degC;/);
  assert.match(said, /order of their own.*--keep-order/);
  const told_m = Number(/rounded to ([0-9.e-]+) mm/.exec(said)[1]) / 1000;
  const order = await loadedDraco(fused("drc", scene, "--keep-order").output);
  let farthest_m = 0;
  for (const [axis, get] of [["x", "getX"], ["y", "getY"], ["z", "getZ"]]) {
    for (let i = 0; i < picture.vertexCount; ++i) {
      farthest_m = Math.max(farthest_m, Math.abs(order.attributes.position[get](i) - picture[axis][i]));
    }
  }
  assert.ok(farthest_m < 0.501 * told_m && farthest_m > 0.05 * told_m, `${farthest_m} of ${told_m}`);
  const identityOf = ({ attributes, index }) => {
    const colours = screenColours(attributes.color);
    const hashes = colours.map((colour, i) =>
      cornerHash(
        [attributes.position.getX(i), attributes.position.getY(i), attributes.position.getZ(i)].map((metres) =>
          nearestLattice(metres, told_m / 1024),
        ),
        colour,
      ),
    );
    const identity = new MeshIdentity();
    for (let i = 0; i < index.count; i += 3) {
      const corners = [0, 1, 2].map((corner) => index.getX(i + corner));
      if (new Set(corners).size === 3) identity.addTriangle(...corners.map((corner) => hashes[corner]));
    }
    return `${identity}`;
  };
  assert.equal(identityOf(await loadedDraco(output)), identityOf(order));
});

test("of vertices of no triangle a Draco file is said to keep what it keeps", () => {
  const input = written("loose.ply", {
    header: [...kFloats, "float temperature"],
    vertices: [[0, 0, 0, 20], [1, 0, 0, 21], [0, 1, 0.5, 22], [0.5, 0.5, 0.5, 23]],
    triangles: [[0, 1, 2]],
  });
  const kept = /1 vertex of no triangle: not drawn, though kept/;
  const leftOut = /In the file 1 vertex of no triangle is left out, though their temperatures count; --keep-order keeps them/;
  const small = fused("drc", input).said;
  assert.match(small, leftOut);
  assert.doesNotMatch(small, kept);
  const ordered = fused("drc", input, "--keep-order").said;
  assert.match(ordered, kept);
  assert.doesNotMatch(ordered, leftOut);
});

test("a Draco file keeps what is small in a large scene", async () => {
  // A map of 2 km with vertices every 20 m, and in it a bowl of 5 cm.
  const vertices = [];
  const triangles = [];
  const grid = (count, at) => {
    const first = vertices.length;
    for (let i = 0; i < count * count; ++i) vertices.push([...at(i % count, Math.floor(i / count)), 20]);
    for (let y = 0; y + 1 < count; ++y) {
      for (let x = 0; x + 1 < count; ++x) {
        const corner = first + y * count + x;
        triangles.push([corner, corner + 1, corner + count], [corner + 1, corner + count + 1, corner + count]);
      }
    }
  };
  grid(100, (x, y) => [20 * x, 20 * y, Math.sin(x) + Math.cos(y)]);
  const small = vertices.length;
  grid(20, (x, y) => [900 + x / 400, 900 + y / 400, 20 + ((x - 10) ** 2 + (y - 10) ** 2) / 4000]);
  const input = written("map.ply", { header: [...kFloats, "float temperature"], vertices, triangles });
  const { attributes } = await loadedDraco(fused("drc", input, "--keep-order").output);
  const places = new Set();
  for (let i = small; i < vertices.length; ++i) {
    const place = [attributes.position.getX(i), attributes.position.getY(i), attributes.position.getZ(i)];
    for (let axis = 0; axis < 3; ++axis) assert.ok(Math.abs(place[axis] - vertices[i][axis]) < 0.002, `${place} of ${vertices[i]}`);
    places.add(`${place}`);
  }
  assert.equal(places.size, 400);
});

test("three.js reads the Draco files that keep more", async () => {
  const order = await loadedDraco(fused("drc", scene, "--keep-order").output);
  const exact = await loadedDraco(fused("drc", scene, "--lossless").output);
  for (const { attributes, index } of [order, exact]) {
    assert.deepEqual(screenColours(attributes.color), coloursOf(picture));
    assert.deepEqual(Uint32Array.from(index.array), picture.triangles);
  }
  const exactly = exact.attributes;
  const nearly = order.attributes;
  for (let i = 0; i < picture.vertexCount; ++i) {
    assert.deepEqual([exactly.position.getX(i), exactly.position.getY(i), exactly.position.getZ(i)], [picture.x[i], picture.y[i], picture.z[i]]);
    const celsius = picture.temperature[i];
    assert.ok(Object.is(exactly.temperature.getX(i), celsius));
    const rounded = nearly.temperature.getX(i);
    assert.ok(Number.isNaN(celsius) ? rounded === -1000 : Math.abs(rounded - celsius) <= 1 / 128);
  }
  assert.doesNotMatch(fused("drc", scene, "--lossless").said, /In the file/, "nothing was lost");
});

test("a Draco file is smaller the less it keeps", () => {
  const sizes = [[], ["--keep-order"], ["--lossless"]].map((options) => readFileSync(fused("drc", scene, ...options).output).length);
  const ply = readFileSync(fused("ply").output).length;
  assert.ok(sizes[0] < 0.35 * ply, `${sizes[0]} of ${ply} bytes`);
  assert.ok(sizes[0] < sizes[1] && sizes[1] < sizes[2] && sizes[2] < ply, `${sizes}`);
});

const isInstalled = (program) => spawnSync(program, ["version"]).error === undefined;
function converted(program, ...args) {
  const { status, stdout, stderr } = spawnSync(program, args, { encoding: "utf8" });
  assert.equal(status, 0, `${program}: ${stdout}${stderr}`);
  return stdout;
}

test("assimp reads the PLY and the GLB", { skip: !isInstalled("assimp") && "assimp is not installed" }, async () => {
  for (const ending of ["ply", "glb"]) {
    const facts = converted("assimp", "info", fused(ending).output, "--raw");
    assert.match(facts, new RegExp(`Vertices:\\s+${picture.vertexCount}\n`), facts);
    assert.match(facts, new RegExp(`Faces:\\s+${picture.triangles.length / 3}\n`), facts);
  }
});

test("draco_decoder reads the Draco files", { skip: !isInstalled("draco_decoder") && "draco_decoder is not installed" }, () => {
  const output = inFolder("decoded.ply");
  converted("draco_decoder", "-i", fused("drc", scene, "--keep-order").output, "-o", output);
  const seen = readPly(output);
  assert.deepEqual(coloursOf(seen), coloursOf(picture));
  assert.deepEqual(seen.triangles, picture.triangles);
});
