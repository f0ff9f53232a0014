// A client of the Spectra protocol, written from docs/protocol.md alone: it shares no code with web/ or the server, so
// that it tests the document as well as the program.
import draco3d from "draco3d";
import WebSocket from "ws";

export const KIND = {
  geometry: 1,
  colours: 2,
  remove: 3,
  temperature: 4,
  visible: 5,
  colours_subtract_green: 6,
  visible_subtract_green: 7,
  temperature_sigma: 8,
};
export const isColours = ({ kind }) => kind === KIND.colours || kind === KIND.colours_subtract_green;
const MAGIC = 0x31435053;

/** What a code of kinds 4 and 8 stands for. */
export function celsiusOf(code, { scale, offset }) {
  if (code >= 65533) return [-Infinity, Infinity, NaN][code - 65533];
  const perDegree = Math.round(1 / scale);
  const first = Math.round(offset * perDegree);
  const isWholePart = Math.fround(1 / perDegree) === scale && Math.fround(first / perDegree) === offset && Math.abs(first) <= 2 ** 22;
  return isWholePart ? Math.fround((first + code) / perDegree) : Math.fround(Math.fround(code * scale) + offset);
}

/** Reads the header of a binary message; throws on anything docs/protocol.md does not allow. */
export function readFrame(buffer) {
  const view = new DataView(buffer.buffer, buffer.byteOffset, buffer.byteLength);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("frame: wrong magic");
  const headerSize = view.getUint16(6, true);
  const payloadSize = view.getUint32(68, true);
  if (headerSize < 72 || headerSize + payloadSize !== buffer.byteLength) throw new Error("frame: sizes do not fit");
  const level = view.getUint8(16);
  const position = [20, 24, 28].map((offset) => view.getUint32(offset, true));
  return {
    kind: view.getUint8(4),
    childMask: view.getUint8(5),
    sequence: view.getUint32(8, true),
    generation: view.getUint32(12, true),
    tile: [level, ...position].join("/"),
    level,
    position,
    revision: view.getUint32(32, true),
    vertexCount: view.getUint32(36, true),
    origin: [40, 44, 48].map((offset) => view.getFloat32(offset, true)),
    step: view.getFloat32(52, true),
    geometricError: view.getFloat32(56, true),
    lowest: view.getFloat32(60, true),
    highest: view.getFloat32(64, true),
    colourError: headerSize >= 80 ? view.getFloat32(72, true) : NaN,
    temperatureError: headerSize >= 80 ? view.getFloat32(76, true) : NaN,
    payload: buffer.subarray(headerSize),
  };
}

/** Draco decoding by the reference wasm build. */
export class DracoReader {
  static async create() {
    return new DracoReader(await draco3d.createDecoderModule({}));
  }

  constructor(module) {
    this.module = module;
  }

  #decoded(bytes, use) {
    const { module } = this;
    const decoder = new module.Decoder();
    const buffer = new module.DecoderBuffer();
    buffer.Init(new Int8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength), bytes.byteLength);
    const isMesh = decoder.GetEncodedGeometryType(buffer) === module.TRIANGULAR_MESH;
    const geometry = isMesh ? new module.Mesh() : new module.PointCloud();
    const status = isMesh ? decoder.DecodeBufferToMesh(buffer, geometry) : decoder.DecodeBufferToPointCloud(buffer, geometry);
    try {
      if (!status.ok()) throw new Error(`draco: ${status.error_msg()}`);
      return use(decoder, geometry, isMesh);
    } finally {
      module.destroy(geometry);
      module.destroy(buffer);
      module.destroy(decoder);
    }
  }

  #values(decoder, geometry, semantic, type, components) {
    const { module } = this;
    const id = decoder.GetAttributeId(geometry, semantic);
    if (id < 0) throw new Error("draco: attribute missing");
    const attribute = decoder.GetAttribute(geometry, id);
    if (attribute.num_components() !== components) throw new Error("draco: attribute of another size");
    const ArrayType = type === module.DT_FLOAT32 ? Float32Array : type === module.DT_UINT16 ? Uint16Array : Uint8Array;
    const count = geometry.num_points() * components;
    const size = count * ArrayType.BYTES_PER_ELEMENT;
    const pointer = module._malloc(size);
    decoder.GetAttributeDataArrayForAllPoints(geometry, attribute, type, size, pointer);
    const values = new ArrayType(module.HEAPU8.buffer, pointer, count).slice();
    module._free(pointer);
    return values;
  }

  #indices(decoder, mesh) {
    const { module } = this;
    const count = mesh.num_faces() * 3;
    const pointer = module._malloc(count * 4);
    decoder.GetTrianglesUInt32Array(mesh, count * 4, pointer);
    const indices = new Uint32Array(module.HEAPU8.buffer, pointer, count).slice();
    module._free(pointer);
    return indices;
  }

  geometry(bytes) {
    const { module } = this;
    return this.#decoded(bytes, (decoder, geometry, isMesh) => {
      const positions = this.#values(decoder, geometry, module.POSITION, module.DT_FLOAT32, 3);
      return { positions, indices: isMesh ? this.#indices(decoder, geometry) : new Uint32Array(0) };
    });
  }

  /** A stream that holds mesh and colours at once. */
  colouredMesh(bytes) {
    const { module } = this;
    return this.#decoded(bytes, (decoder, geometry) => ({
      positions: this.#values(decoder, geometry, module.POSITION, module.DT_FLOAT32, 3),
      colours: this.#values(decoder, geometry, module.COLOR, module.DT_UINT8, 3),
      indices: this.#indices(decoder, geometry),
    }));
  }

  colours(bytes) {
    const { module } = this;
    return this.#decoded(bytes, (decoder, geometry) =>
      this.#values(decoder, geometry, module.COLOR, module.DT_UINT8, 3),
    );
  }

  /** Scale and offset, and a code for each vertex. */
  temperature(bytes) {
    const { module } = this;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const codes = this.#decoded(bytes.subarray(8), (decoder, geometry) =>
      this.#values(decoder, geometry, module.GENERIC, module.DT_UINT16, 1),
    );
    return { scale: view.getFloat32(0, true), offset: view.getFloat32(4, true), codes };
  }

  /** Colours of kind 6: green, and red and blue as differences from it modulo 256. */
  coloursSubtractGreen(bytes) {
    const { module } = this;
    return this.#decoded(bytes, (decoder, geometry) => {
      const green = this.#values(decoder, geometry, module.COLOR, module.DT_UINT8, 1);
      const differences = this.#values(decoder, geometry, module.GENERIC, module.DT_UINT8, 2);
      const colours = new Uint8Array(3 * green.length); // stores modulo 256
      for (let i = 0; i < green.length; ++i) {
        colours[3 * i] = green[i] + differences[2 * i];
        colours[3 * i + 1] = green[i];
        colours[3 * i + 2] = green[i] + differences[2 * i + 1];
      }
      return colours;
    });
  }
}

/** One connection: requests, notifications, tiles. Frames are decoded as they come and acknowledged. */
export class SpectraClient {
  static async connect(httpUrl, { decode = true, acknowledge = true, hello: form, ca, token } = {}) {
    const client = new SpectraClient();
    client.draco = await DracoReader.create();
    client.decode = decode;
    client.acknowledge = acknowledge;
    client.socket = new WebSocket(`${httpUrl.replace(/^http/, "ws").replace(/\/$/, "")}/ws${form ? `?hello=${form}` : ""}`, "spectra.v1", {
      perMessageDeflate: false,
      ca,
      headers: token ? { Authorization: `Bearer ${token}` } : {},
    });
    client.socket.binaryType = "nodebuffer";
    const hello = client.notification("hello", 30_000);
    client.socket.on("message", (data, isBinary) => client.#receive(data, isBinary));
    hello.catch(() => {});
    client.closed = new Promise((resolve) =>
      client.socket.once("close", (code, reason) => {
        client.#end(new Error(`the connection was closed: ${code} ${reason}`));
        resolve(code);
      }),
    );
    await new Promise((resolve, reject) => {
      client.socket.once("open", resolve);
      client.socket.once("error", reject);
    });
    client.hello = await hello;
    return client;
  }

  constructor() {
    this.tiles = new Map(); // tile id -> {frame, geometry, colours, generation}
    this.frames = []; // {kind, generation, sequence, bytes, tile}
    this.received_bytes = 0;
    this.nextId = 1;
    this.pending = new Map();
    this.waiters = [];
    this.notifications = [];
    this.failures = [];
    this.lastSequence = 0;
  }

  /** Resolves with the result, after `onResult` was called with it before anything that followed it on the wire. */
  request(method, params = {}, onResult = () => {}) {
    const id = this.nextId++;
    return new Promise((fulfil, reject) => {
      const resolve = (result) => {
        onResult(result);
        fulfil(result);
      };
      this.pending.set(id, { resolve, reject });
      this.socket.send(JSON.stringify({ jsonrpc: "2.0", id, method, params }));
    });
  }

  /** What it can claim on another connection: its tiles with colours. */
  claims() {
    const held = [...this.tiles.values()].filter((tile) => tile.colours);
    return held.map(({ frame }) => [frame.level, ...frame.position, frame.revision]);
  }

  /** What beside their geometry it holds of the tiles that it claims. */
  layersOf(claims) {
    const held = claims.map((claim) => this.tiles.get(claim.slice(0, 4).join("/")));
    const places = (has) => held.flatMap((tile, place) => (tile && has(tile) ? [place] : []));
    return {
      raw: places(({ temperature, visible }) => temperature && visible),
      temperature_sigma: places(({ sigma }) => sigma),
      colours: places(({ colourSequence }) => colourSequence !== undefined).map((place) => [place, held[place].colourSequence]),
    };
  }

  /**
   * Subscribes as a client does after a drop-out, with the tiles of the connection before; returns resumed_tiles. With `layers` it says
   * what else it holds of them.
   */
  async resume(earlier, { session_id = earlier.hello.session_id, tiles = earlier.claims(), layers = false, ...params } = {}) {
    const held = tiles.map((claim) => earlier.tiles.get(claim.slice(0, 4).join("/"))).filter(Boolean);
    const kept = layers ? earlier.layersOf(tiles) : {};
    const told = new Set((kept.colours ?? []).map(([place]) => tiles[place].slice(0, 4).join("/")));
    const sequence = (tile) => (told.has(tile.frame.tile) ? 0 : undefined);
    this.tiles = new Map(held.map((tile) => [tile.frame.tile, { ...tile, generation: 0, colourSequence: sequence(tile) }]));
    const request = { channels: ["fused"], ...params, resume: { session_id, tiles, ...kept } };
    const { resumed_tiles } = await this.request("scene.subscribe", request, (result) => {
      if (!result.resumed_tiles) this.tiles.clear();
      for (const place of result.current_colours ?? []) {
        this.tiles.get(tiles[place].slice(0, 4).join("/")).generation = result.generation;
      }
    });
    return resumed_tiles;
  }

  notify(method, params) {
    this.socket.send(JSON.stringify({ jsonrpc: "2.0", method, params }));
  }

  /** Resolves with the params of the next notification of that name that passes the filter. */
  notification(name, timeout_ms = 60_000, filter = () => true) {
    return new Promise((resolve, reject) => {
      const waiter = { name, filter, resolve };
      const timer = setTimeout(() => {
        this.waiters = this.waiters.filter((other) => other !== waiter);
        reject(new Error(`no notification ${name} within ${timeout_ms} ms`));
      }, timeout_ms);
      waiter.resolve = (params) => {
        clearTimeout(timer);
        resolve(params);
      };
      waiter.reject = (error) => {
        clearTimeout(timer);
        reject(error);
      };
      this.waiters.push(waiter);
    });
  }

  complete(generation, timeout_ms = 120_000) {
    const before = this.notifications.find((n) => n.method === "stream.complete" && n.params.generation >= generation);
    if (before) return Promise.resolve(before.params);
    return this.notification("stream.complete", timeout_ms, (params) => params.generation >= generation);
  }

  close() {
    this.socket.close();
    return this.closed;
  }

  /** Nobody waits for what cannot come any more. */
  #end(error) {
    for (const { reject } of [...this.pending.values(), ...this.waiters]) reject(error);
    this.pending.clear();
    this.waiters = [];
  }

  #receive(data, isBinary) {
    try {
      if (isBinary) this.#receiveFrame(data);
      else this.#receiveText(JSON.parse(data.toString()));
    } catch (error) {
      this.failures.push(error);
    }
  }

  #receiveText(message) {
    if (message.method === undefined) {
      const pending = this.pending.get(message.id);
      this.pending.delete(message.id);
      if (!pending) this.notifications.push({ method: "(error)", params: message.error });
      else if (message.error) pending.reject(Object.assign(new Error(message.error.message), message.error));
      else pending.resolve(message.result);
      return;
    }
    this.notifications.push(message);
    const waiting = this.waiters.filter((w) => w.name === message.method && w.filter(message.params));
    this.waiters = this.waiters.filter((w) => !waiting.includes(w));
    for (const waiter of waiting) waiter.resolve(message.params);
  }

  #receiveFrame(data) {
    const frame = readFrame(data);
    if (frame.sequence !== this.lastSequence + 1) {
      throw new Error(`frame ${frame.sequence} follows ${this.lastSequence}`);
    }
    this.lastSequence = frame.sequence;
    this.received_bytes += data.byteLength;
    this.frames.push({
      kind: frame.kind,
      generation: frame.generation,
      tile: frame.tile,
      revision: frame.revision,
      bytes: data.byteLength,
    });
    if (this.decode) this.#apply(frame);
    if (this.acknowledge) this.notify("stream.ack", { sequence: frame.sequence });
  }

  #apply(frame) {
    if (frame.kind === KIND.remove) {
      this.tiles.delete(frame.tile);
    } else if (frame.kind === KIND.geometry) {
      const geometry = this.draco.geometry(frame.payload);
      if (geometry.positions.length !== 3 * frame.vertexCount) throw new Error("geometry: vertex count differs");
      this.tiles.set(frame.tile, { frame, geometry, colours: null, generation: 0 });
    } else if (isColours(frame)) {
      const tile = this.tiles.get(frame.tile);
      if (!tile || tile.frame.revision !== frame.revision) throw new Error("colours before their geometry");
      if (frame.generation < tile.generation) throw new Error("colours of an older generation after newer ones");
      const isPlain = frame.kind === KIND.colours;
      const colours = isPlain ? this.draco.colours(frame.payload) : this.draco.coloursSubtractGreen(frame.payload);
      if (colours.length !== tile.geometry.positions.length) throw new Error("colours: vertex count differs");
      tile.colours = colours;
      tile.generation = frame.generation;
      tile.colourSequence = frame.sequence;
    } else if (frame.kind === KIND.temperature_sigma) {
      const tile = this.tiles.get(frame.tile);
      if (!tile || tile.frame.revision !== frame.revision) throw new Error("sigma before its geometry");
      tile.sigma = this.draco.temperature(frame.payload);
    } else if (frame.kind === KIND.temperature || frame.kind === KIND.visible || frame.kind === KIND.visible_subtract_green) {
      const tile = this.tiles.get(frame.tile);
      if (!tile || tile.frame.revision !== frame.revision) throw new Error("a raw layer before its geometry");
      if (frame.vertexCount !== tile.frame.vertexCount) throw new Error("a raw layer of another vertex count");
      if (frame.kind === KIND.temperature) tile.temperature = this.draco.temperature(frame.payload);
      else if (frame.kind === KIND.visible) tile.visible = this.draco.colours(frame.payload);
      else tile.visible = this.draco.coloursSubtractGreen(frame.payload);
    }
  }

  /** Tiles to draw by the REPLACE rule: held with colours, and not every child can be drawn in their place. */
  drawnTiles() {
    const drawable = (id) => Boolean(this.tiles.get(id)?.colours);
    const replaced = (tile) => {
      const { childMask, level, position } = tile.frame;
      if (childMask === 0) return false;
      for (let i = 0; i < 8; ++i) {
        if (!((childMask >> i) & 1)) continue;
        const child = position.map((value, axis) => 2 * value + ((i >> axis) & 1));
        const id = [level + 1, ...child].join("/");
        if (!drawable(id)) return false;
      }
      return true;
    };
    return [...this.tiles.values()].filter((tile) => tile.colours && !replaced(tile));
  }
}
