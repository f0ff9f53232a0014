// A small stand-in for the server: speaks the protocol with a PLY or a generated scene, for work on the client alone.
//   node e2e/mock_server.mjs [SCENE.ply] [--port N] [--root DIR]
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { createRequire } from 'node:module';
import { WebSocketServer } from 'ws';

const require = createRequire(import.meta.url);
const draco = await require('draco3d').createEncoderModule({});

const TYPES = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.wasm': 'application/wasm',
  '.svg': 'image/svg+xml',
};
export const POLICY =
  "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; connect-src 'self'; img-src 'self' data: blob:; " +
  "style-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

function readPly(path) {
  const file = readFileSync(path);
  const start = file.indexOf('end_header\n') + 11;
  const header = file.toString('latin1', 0, start);
  const vertexCount = Number(/element vertex (\d+)/.exec(header)[1]);
  const faceCount = Number(/element face (\d+)/.exec(header)?.[1] ?? 0);
  const thermal = /property float temperature/.test(header);
  const stride = thermal ? 19 : 15;
  const positions = new Float32Array(vertexCount * 3);
  const colours = new Uint8Array(vertexCount * 3);
  const temperatures = new Float32Array(vertexCount).fill(Number.NaN);
  for (let i = 0; i < vertexCount; i += 1) {
    const at = start + i * stride;
    for (let k = 0; k < 3; k += 1) {
      positions[i * 3 + k] = file.readFloatLE(at + 4 * k);
      colours[i * 3 + k] = file[at + 12 + k];
    }
    if (thermal) temperatures[i] = file.readFloatLE(at + 15);
  }
  const faces = new Uint32Array(faceCount * 3);
  for (let j = 0, at = start + vertexCount * stride; j < faceCount; j += 1, at += 13) {
    for (let k = 0; k < 3; k += 1) faces[j * 3 + k] = file.readInt32LE(at + 1 + 4 * k);
  }
  return { name: path.split('/').pop(), positions, colours, temperatures, faces };
}

/** A checkered hill of 200 x 200 vertices with one hot and one cold spot and a hole without temperature. */
function generatedScene() {
  const n = 200;
  const positions = new Float32Array(n * n * 3);
  const colours = new Uint8Array(n * n * 3);
  const temperatures = new Float32Array(n * n);
  const faces = [];
  for (let j = 0; j < n; j += 1) {
    for (let i = 0; i < n; i += 1) {
      const v = j * n + i;
      const x = (i / (n - 1)) * 4 - 2;
      const z = (j / (n - 1)) * 4 - 2;
      positions.set([x, 0.5 * Math.exp(-(x * x + z * z)), z], v * 3);
      const light = (Math.floor(i / 20) + Math.floor(j / 20)) % 2 ? 200 : 70;
      colours.set([light, light, light - 20], v * 3);
      temperatures[v] = 20 + 17 * Math.exp(-8 * ((x - 1) ** 2 + z * z)) - 12 * Math.exp(-8 * ((x + 1) ** 2 + z * z));
      if ((x + 1.4) ** 2 + (z - 1.4) ** 2 < 0.1) temperatures[v] = Number.NaN;
      if (i > 0 && j > 0) faces.push(v - n - 1, v - 1, v, v - n - 1, v, v - n);
    }
  }
  return { name: 'checkered hill', positions, colours, temperatures, faces: Uint32Array.from(faces) };
}

function bytesOf(out, size) {
  const bytes = Buffer.alloc(size);
  for (let i = 0; i < size; i += 1) bytes[i] = out.GetValue(i);
  draco.destroy(out);
  return bytes;
}

function encodedGeometry(positions, faces) {
  const builder = new draco.MeshBuilder();
  const mesh = new draco.Mesh();
  builder.AddFacesToMesh(mesh, faces.length / 3, faces);
  builder.AddFloatAttributeToMesh(mesh, draco.POSITION, positions.length / 3, 3, positions);
  const encoder = new draco.Encoder();
  encoder.SetEncodingMethod(draco.MESH_SEQUENTIAL_ENCODING);
  encoder.SetAttributeQuantization(draco.POSITION, 16);
  const out = new draco.DracoInt8Array();
  const bytes = bytesOf(out, encoder.EncodeMeshToDracoBuffer(mesh, out));
  draco.destroy(encoder);
  draco.destroy(mesh);
  draco.destroy(builder);
  return bytes;
}

function encodedColours(colours) {
  const builder = new draco.PointCloudBuilder();
  const cloud = new draco.PointCloud();
  builder.AddUInt8Attribute(cloud, draco.COLOR, colours.length / 3, 3, colours);
  const encoder = new draco.ExpertEncoder(cloud);
  encoder.SetEncodingMethod(0);
  const out = new draco.DracoInt8Array();
  const bytes = bytesOf(out, encoder.EncodeToDracoBuffer(false, out));
  draco.destroy(encoder);
  draco.destroy(cloud);
  draco.destroy(builder);
  return bytes;
}

function tilesOf(scene) {
  const tiles = [];
  const perTile = 40_000;
  for (let first = 0; first < scene.faces.length / 3; first += perTile) {
    const part = scene.faces.subarray(first * 3, (first + perTile) * 3);
    const local = new Map();
    const vertices = [];
    const faces = Uint32Array.from(part, (v) => {
      if (!local.has(v)) {
        local.set(v, vertices.length);
        vertices.push(v);
      }
      return local.get(v);
    });
    const positions = new Float32Array(vertices.length * 3);
    vertices.forEach((v, i) => positions.set(scene.positions.subarray(v * 3, v * 3 + 3), i * 3));
    tiles.push({ vertices, geometry: encodedGeometry(positions, faces) });
  }
  return tiles;
}

const STOPS = [
  [8, 6, 40],
  [90, 15, 130],
  [190, 45, 90],
  [240, 120, 30],
  [255, 230, 120],
];
function table(stops) {
  return Array.from({ length: 256 }, (_, i) => {
    const at = (i / 255) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(at));
    return [0, 1, 2].map((c) => stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c]));
  });
}
const PALETTES = [
  { id: 'iron', label: 'Iron', fusion_safe: false, colours: table(STOPS) },
  {
    id: 'white_hot',
    label: 'White hot',
    fusion_safe: false,
    colours: table([
      [0, 0, 0],
      [255, 255, 255],
    ]),
  },
  {
    id: 'rainbow_safe',
    label: 'Rainbow, fusion safe',
    fusion_safe: true,
    colours: table([
      [60, 60, 255],
      [0, 220, 220],
      [40, 220, 40],
      [240, 220, 0],
      [255, 50, 40],
    ]),
  },
];
const alpha = {
  name: 'alpha',
  label: 'Thermal share',
  help: '0 shows the visible colour, 1 the thermal one.',
  kind: 'number',
  default: 0.5,
  min: 0,
  max: 1,
  step: 0.01,
  unit: '',
};
const METHODS = [
  {
    id: 'thermal_only',
    label: 'Thermal',
    summary: 'The palette colour of the temperature.',
    needs_temperature: true,
    uses_palette: true,
    params: [],
  },
  {
    id: 'visible_only',
    label: 'Visible',
    summary: 'The visible colour alone.',
    needs_temperature: false,
    uses_palette: false,
    params: [],
  },
  {
    id: 'thermal_visible_blend',
    label: 'Blend',
    summary: 'Both, mixed everywhere.',
    needs_temperature: true,
    uses_palette: true,
    params: [alpha],
  },
  {
    id: 'colour_mapped_threshold',
    label: 'Threshold',
    summary: 'Thermal where it is warmer than a threshold.',
    needs_temperature: true,
    uses_palette: true,
    params: [
      {
        name: 'threshold',
        label: 'Threshold',
        help: 'Where the thermal colour begins.',
        kind: 'temperature',
        default: null,
        unit: 'degC',
      },
      alpha,
      { name: 'invert', label: 'Invert', help: 'Show what is colder instead.', kind: 'toggle', default: false },
      {
        name: 'sides',
        label: 'Sides',
        help: 'Which side of the range.',
        kind: 'choice',
        default: 'both',
        options: ['both', 'hot', 'cold'],
      },
      { name: 'bins', label: 'Bins', help: 'How many bins.', kind: 'integer', default: 64, min: 1, max: 4096 },
    ],
  },
];

/** Serves until stop() is called; `port` 0 picks a free one. */
export async function startMockServer({ ply, port = 0, root = new URL('../dist', import.meta.url).pathname, delay_ms = 0 } = {}) {
  const scene = ply ? readPly(ply) : generatedScene();
  const tiles = tilesOf(scene);
  const finite = [...scene.temperatures.keys()].filter((i) => Number.isFinite(scene.temperatures[i]));
  const thermal = finite.length > 0;
  let lowest = Infinity;
  let highest = -Infinity;
  let mean = 0;
  for (const i of finite) {
    const t = scene.temperatures[i];
    lowest = Math.min(lowest, t);
    highest = Math.max(highest, t);
    mean += t / finite.length;
  }
  let variance = 0;
  for (const i of finite) variance += (scene.temperatures[i] - mean) ** 2 / finite.length;
  const bounds = { min: [Infinity, Infinity, Infinity], max: [-Infinity, -Infinity, -Infinity] };
  scene.positions.forEach((x, i) => {
    bounds.min[i % 3] = Math.min(bounds.min[i % 3], x);
    bounds.max[i % 3] = Math.max(bounds.max[i % 3], x);
  });
  const description = {
    name: scene.name,
    revision: 1,
    vertex_count: scene.temperatures.length,
    triangle_count: scene.faces.length / 3,
    point_cloud: false,
    origin: [0, 0, 0],
    bounds,
    tile_count: tiles.length,
    levels: 1,
    temperature: thermal
      ? { min: lowest, max: highest, mean, sigma: Math.sqrt(variance), missing_count: scene.temperatures.length - finite.length }
      : { min: null, max: null, mean: null, sigma: null, missing_count: scene.temperatures.length },
  };

  const http = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, 'http://x').pathname));
    try {
      const body = readFileSync(join(root, path === '/' ? 'index.html' : path));
      response.writeHead(200, { 'content-type': TYPES[extname(path)] ?? 'text/html', 'content-security-policy': POLICY });
      response.end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  const sockets = new WebSocketServer({ server: http, path: '/ws', handleProtocols: () => 'spectra.v1' });
  const log = [];
  let connections = 0;

  sockets.on('connection', (socket) => {
    connections += 1;
    let generation = 1;
    let sequence = 0;
    let subscribed = false;
    let settings = {
      method: thermal ? 'thermal_visible_blend' : 'visible_only',
      params: thermal ? { alpha: 0.5 } : {},
      palette: 'iron',
      range: { mode: 'auto', min: null, max: null },
      missing: 'visible',
    };
    const fusion = () => {
      const range =
        settings.range.mode === 'manual'
          ? settings.range
          : { mode: 'auto', min: thermal ? lowest : null, max: thermal ? highest : null };
      const force = { ...settings.params };
      if ('threshold' in force && force.threshold === null)
        force.threshold = thermal ? range.min + 0.75 * (range.max - range.min) : null;
      return { ...settings, range, params_in_force: force };
    };
    let quality = {
      mode: 'manual',
      position_step_mm: 1,
      colour_bits: 8,
      pixel_error: 1,
      encoder_speed: 7,
      latency_target_ms: 200,
    };
    const say = (message) =>
      setTimeout(
        () =>
          socket.send(
            typeof message === 'string' || Buffer.isBuffer(message) ? message : JSON.stringify({ jsonrpc: '2.0', ...message }),
          ),
        delay_ms,
      );
    const fused = (v) => {
      const { method, params_in_force, range, palette } = fusion();
      const visible = [...scene.colours.subarray(v * 3, v * 3 + 3)];
      const t = scene.temperatures[v];
      if (method === 'visible_only') return visible;
      if (!Number.isFinite(t))
        return settings.missing === 'visible' ? visible : [1, 3, 5].map((i) => parseInt(settings.missing.slice(i, i + 2), 16));
      const u = Math.min(1, Math.max(0, (t - range.min) / (range.max - range.min)));
      const m = PALETTES.find((p) => p.id === palette).colours[Math.round(u * 255)];
      const a =
        method === 'thermal_only'
          ? 1
          : method === 'colour_mapped_threshold' && !(t > params_in_force.threshold !== params_in_force.invert)
            ? 0
            : params_in_force.alpha;
      return visible.map((c, k) => Math.min(255, Math.floor(a * m[k] + (1 - a) * c + 0.5)));
    };
    const frame = (kind, index, tile, payload) => {
      sequence += 1;
      const header = Buffer.alloc(72);
      header.writeUInt32LE(0x31435053, 0);
      header.writeUInt8(kind, 4);
      header.writeUInt16LE(72, 6);
      header.writeUInt32LE(sequence, 8);
      header.writeUInt32LE(generation, 12);
      header.writeUInt8(5, 16);
      header.writeUInt32LE(index, 20);
      header.writeUInt32LE(1, 32);
      header.writeUInt32LE(tile.vertices.length, 36);
      header.writeFloatLE(0.001, 52);
      header.writeUInt32LE(payload.length, 68);
      say(Buffer.concat([header, payload]));
    };
    let turn = 0;
    const send = async (geometry) => {
      turn += 1;
      const mine = turn;
      for (const [index, tile] of tiles.entries()) {
        if (mine !== turn) return;
        if (geometry) frame(1, index, tile, tile.geometry);
        const colours = new Uint8Array(tile.vertices.length * 3);
        tile.vertices.forEach((v, i) => colours.set(fused(v), i * 3));
        frame(2, index, tile, encodedColours(colours));
        await new Promise((resolve) => setImmediate(resolve));
      }
      say({
        method: 'stream.complete',
        params: { generation, scene_revision: 1, tiles: tiles.length, vertices: description.vertex_count },
      });
      say({
        method: 'stream.stats',
        params: {
          round_trip_ms: 2,
          throughput_bytes_per_s: 1e6,
          queued_bytes: 0,
          skipped_frames: 0,
          viewers: sockets.clients.size,
          accuracy: { position_mm: 0.5, colour_levels: 1 << quality.colour_bits, pixel_error: 0 },
        },
      });
    };
    let sentGeometry = false;
    const refuse = (id, field, reason) =>
      say({ id, error: { code: -32602, message: 'invalid parameters', data: { field, reason } } });
    const nearest = ([x, y, z]) => {
      let best = 0;
      let distance = Infinity;
      for (let i = 0; i < description.vertex_count; i += 1) {
        const d =
          (scene.positions[i * 3] - x) ** 2 + (scene.positions[i * 3 + 1] - y) ** 2 + (scene.positions[i * 3 + 2] - z) ** 2;
        if (d < distance) [best, distance] = [i, d];
      }
      return { best, distance: Math.sqrt(distance) };
    };
    const at = (v) => [...scene.positions.subarray(v * 3, v * 3 + 3)];
    socket.on('message', (data) => {
      const { id, method, params } = JSON.parse(data.toString());
      log.push({ method, params });
      const answer = (result) => say({ id, result });
      if (method === 'scene.subscribe') {
        subscribed = true;
        answer({});
        void send(!sentGeometry);
        sentGeometry = true;
      } else if (method === 'fusion.set') {
        const schema = METHODS.find((m) => m.id === (params.method ?? settings.method));
        if (!schema) return refuse(id, 'method', `no method "${params.method}"`);
        for (const [name, value] of Object.entries(params.params ?? {})) {
          const entry = schema.params.find((p) => p.name === name);
          if (!entry) return refuse(id, `params.${name}`, 'no such parameter');
          if (typeof value === 'number' && (value < (entry.min ?? -Infinity) || value > (entry.max ?? Infinity))) {
            return refuse(id, `params.${name}`, `must be between ${entry.min} and ${entry.max}`);
          }
        }
        const base =
          schema.id === settings.method ? settings.params : Object.fromEntries(schema.params.map((p) => [p.name, p.default]));
        settings = { ...settings, ...params, params: { ...base, ...params.params } };
        generation += 1;
        answer({ generation, fusion: fusion() });
        if (subscribed) void send(false);
      } else if (method === 'fusion.get') answer({ generation, fusion: fusion() });
      else if (method === 'quality.set') {
        quality = { ...quality, ...params };
        answer({ quality });
        if (subscribed) void send(true);
      } else if (method === 'scene.histogram') {
        const { bins } = params;
        const counts = new Array(bins).fill(0);
        for (const i of finite)
          counts[Math.min(bins - 1, Math.floor(((scene.temperatures[i] - lowest) / (highest - lowest)) * bins))] += 1;
        const { params_in_force: p, method: m } = fusion();
        answer(
          thermal
            ? {
                edges: Array.from({ length: bins + 1 }, (_, i) => lowest + (i / bins) * (highest - lowest)),
                counts,
                mean,
                sigma: Math.sqrt(variance),
                highlighted: m === 'colour_mapped_threshold' ? [p.invert ? [lowest, p.threshold] : [p.threshold, highest]] : [],
              }
            : { edges: [], counts: [], mean: null, sigma: null, highlighted: [] },
        );
      } else if (method === 'scene.probe') {
        const { best, distance } = nearest(params.position);
        const t = scene.temperatures[best];
        answer({
          vertex_index: best,
          position: at(best),
          temperature: Number.isFinite(t) ? t : null,
          visible: [...scene.colours.subarray(best * 3, best * 3 + 3)],
          fused: fused(best),
          distance,
        });
      } else if (method === 'scene.extremes') {
        const hot = finite.find((i) => scene.temperatures[i] === highest);
        const cold = finite.find((i) => scene.temperatures[i] === lowest);
        answer({
          hottest: thermal ? { position: at(hot), temperature: highest } : null,
          coldest: thermal ? { position: at(cold), temperature: lowest } : null,
        });
      } else if (id !== undefined) say({ id, error: { code: -32601, message: `no method ${method}` } });
    });
    say({
      method: 'hello',
      params: {
        protocol: 'spectra.v1',
        server: { name: 'mock', version: '0' },
        session_id: String(connections),
        role: 'operator',
        capabilities: [],
        limits: { max_message_bytes: 65536, max_depth: 16, max_requests_per_s: 200 },
        scene: description,
        methods: METHODS,
        palettes: PALETTES,
        fusion: fusion(),
        quality,
      },
    });
  });
  await new Promise((resolve) => http.listen(port, '127.0.0.1', resolve));
  return {
    url: `http://127.0.0.1:${http.address().port}/`,
    log,
    get connections() {
      return connections;
    },
    /** Cuts every connection, as a radio link would. */
    cut: () => sockets.clients.forEach((client) => client.terminate()),
    stop: () => {
      sockets.clients.forEach((client) => client.terminate());
      return new Promise((resolve) => http.close(resolve));
    },
  };
}

if (process.argv[1] === new URL(import.meta.url).pathname) {
  const args = process.argv.slice(2);
  const option = (name) => (args.includes(name) ? args[args.indexOf(name) + 1] : undefined);
  const ply = args[0]?.endsWith('.ply') ? args[0] : undefined;
  const server = await startMockServer({ ply, port: Number(option('--port') ?? 8600) });
  console.log(`listening on ${server.url}`);
}
