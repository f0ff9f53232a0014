import { readdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { DecoderModule } from 'draco3d/draco_decoder_nodejs.js';
import { beforeAll, describe, expect, it } from 'vitest';
import { decodeJob } from '../decode/draco';
import { decodeTileFrame, FrameKind } from './frame';
import * as messages from './messages';

const golden = new URL('../../../protocol/golden/', import.meta.url);
const list = (folder: string, ending: string) =>
  readdirSync(new URL(folder, golden))
    .filter((name) => name.endsWith(ending))
    .sort();
const text = (path: string) => readFileSync(new URL(path, golden), 'utf8');

/** Which reader a golden message of the server needs; the key begins the file's name. */
const readers: Record<string, (value: unknown, path: string) => unknown> = {
  'hello.': messages.hello,
  'scene.get.': messages.scene,
  'scene.changed.': messages.sceneChanged,
  'scene.histogram.': messages.histogram,
  'scene.probe.': messages.probe,
  'scene.extremes.': messages.extremes,
  'fusion.facts.': messages.facts,
  'scene.baseline.': messages.baseline,
  'fusion.': messages.fusionState,
  'quality.set.': messages.qualityState,
  'stream.complete.': messages.streamComplete,
  'stream.stats.': messages.streamStats,
  'robot.moved.': messages.robotMoved,
  'status.': messages.status,
  'scene.subscribe.': messages.subscribed,
  'scene.unsubscribe.': (value) => value,
};
/** May be absent. */
const optionalFields = new Set([
  'resumed_tiles',
  'core_bounds',
  'metric',
  'live',
  'observed',
  'highlighted_share',
  'temperature_range',
  'over_range',
  'under_range',
  'hues',
  'age',
  'change_scale',
  'baseline',
  'baseline_at',
  'observed_at',
  'temperature_sigma',
  'temperature_at',
  'lost',
]);
/** What a viewer sends, or only a sender of blocks is sent. */
const notForViewers = ['camera.set', 'stream.ack', 'ingest.', 'frames.'];
const fromServer = list('messages/', '.json').filter(
  (name) => !name.includes('.request.') && !notForViewers.some((start) => name.startsWith(start)),
);

describe('Golden messages', () => {
  it('are there', () => {
    expect(fromServer.length).toBeGreaterThan(15);
  });

  it.each(fromServer)('%s is read whole', (name) => {
    const source = JSON.parse(text(`messages/${name}`)) as Record<string, unknown>;
    const message = messages.decodeServerMessage(JSON.stringify(source));
    if (message.type === 'error') {
      expect(message.error).toEqual(source['error']);
      return;
    }
    const reader = Object.entries(readers).find(([start]) => name.startsWith(start))?.[1];
    expect(reader, `no reader for ${name}`).toBeDefined();
    const body = message.type === 'result' ? message.result : message.params;
    expect(reader?.(body, name)).toEqual(body);
  });

  it.each(fromServer.filter((name) => !name.startsWith('error.')))('%s is refused without one of its fields', (name) => {
    const reader = Object.entries(readers).find(([start]) => name.startsWith(start))?.[1];
    const source = JSON.parse(text(`messages/${name}`)) as { params?: object; result?: object };
    const body = source.params ?? source.result ?? {};
    // In its place both methods and palettes would do.
    const optional = [
      ...optionalFields,
      ...(name === 'hello.brief.notification.json' ? ['catalogue'] : []),
      ...(name.startsWith('fusion.facts.') ? ['counts'] : []),
      ...(name.startsWith('scene.subscribe.') ? ['current_colours', 'generation'] : []),
    ];
    for (const key of Object.keys(body).filter((name) => !optional.includes(name))) {
      const { [key as keyof typeof body]: _left, ...rest } = body;
      expect(() => reader?.(rest, name), key).toThrow(key);
    }
  });
});

describe('The golden catalogue', () => {
  const source = JSON.parse(text('http/catalogue.json')) as object;

  it('is read whole', () => {
    expect(messages.catalogue(source, 'catalogue')).toEqual(source);
  });

  it('stands in hello, or hello says where it is', () => {
    const { params } = JSON.parse(text('messages/hello.brief.notification.json')) as { params: Record<string, unknown> };
    const { catalogue: _left, ...without } = params;
    expect(() => messages.hello(without, 'hello')).toThrow('hello.methods');
    expect(messages.hello({ ...without, ...source }, 'hello')).toMatchObject(source);
    expect(() => messages.hello({ ...params, catalogue: 1 }, 'hello')).toThrow('hello.catalogue');
  });
});

describe('Golden frames', () => {
  let draco: DecoderModule;
  beforeAll(async () => {
    const require = createRequire(import.meta.url);
    const create = require('draco3d/draco_decoder_nodejs.js') as (options: object) => Promise<DecoderModule>;
    draco = await create({});
  });

  it.each(list('frames/', '.json'))('%s', (name) => {
    const file = readFileSync(new URL(`frames/${name.replace('.json', '.bin')}`, golden));
    const frame = decodeTileFrame(file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength) as ArrayBuffer);
    const expected = JSON.parse(text(`frames/${name}`)) as {
      header: Record<string, unknown> & { tile: number[]; origin_m: number[] };
      positions_m?: number[][];
      triangles?: number[][];
      colours?: number[][];
      marks?: number[];
      visible?: number[][];
      scale?: number;
      offset?: number;
      codes?: number[];
    };
    const { payload, tile, bytes: _bytes, ...fields } = frame;
    const nullIfNone = (value: number) => (Number.isNaN(value) ? null : value);
    expect({
      ...fields,
      lowest_celsius: nullIfNone(fields.lowest_celsius),
      highest_celsius: nullIfNone(fields.highest_celsius),
      colour_error_levels: nullIfNone(fields.colour_error_levels),
      temperature_error_celsius: nullIfNone(fields.temperature_error_celsius),
      tile: [tile.level, tile.x, tile.y, tile.z],
      payload_size_bytes: payload.byteLength,
    }).toEqual(expected.header);

    if (frame.kind === FrameKind.geometry) {
      const decoded = decodeJob(draco, { kind: 'geometry', payload, origin_m: frame.origin_m });
      if (decoded.kind !== 'geometry') throw new Error('not a geometry');
      const origin = expected.header.origin_m;
      const positions = (expected.positions_m ?? []).flatMap((p) => p.map((value, axis) => value + (origin[axis] ?? 0)));
      expect([...decoded.positions]).toEqual(positions);
      expect([...(decoded.indices ?? [])]).toEqual((expected.triangles ?? []).flat());
    } else if (frame.kind === FrameKind.colours || frame.kind === FrameKind.colours_subtract_green) {
      const transform = frame.kind === FrameKind.colours ? 'none' : 'subtract_green';
      const decoded = decodeJob(draco, { kind: 'colours', payload, transform });
      if (decoded.kind !== 'colours') throw new Error('not colours');
      expect([...decoded.rgba]).toEqual(
        (expected.colours ?? []).flatMap((rgb, i) => [...rgb, expected.marks?.[i] === 1 ? 0 : 255]),
      );
      expect([...decoded.rgba].some((alpha, i) => i % 4 === 3 && alpha === 0)).toBe(expected.marks !== undefined);
    } else if (frame.kind === FrameKind.visible || frame.kind === FrameKind.visible_subtract_green) {
      const transform = frame.kind === FrameKind.visible ? 'none' : 'subtract_green';
      const decoded = decodeJob(draco, { kind: 'visible', payload, transform });
      if (decoded.kind !== 'visible') throw new Error('not visible colours');
      expect([...decoded.rgb]).toEqual((expected.visible ?? []).flat());
    } else if (frame.kind === FrameKind.temperature) {
      const decoded = decodeJob(draco, { kind: 'temperature', payload });
      if (decoded.kind !== 'temperature') throw new Error('not temperatures');
      expect([decoded.scale, decoded.offset]).toEqual([Math.fround(expected.scale ?? 0), Math.fround(expected.offset ?? 0)]);
      expect([...decoded.codes]).toEqual(expected.codes);
    } else if (Object.values<number>(FrameKind).includes(frame.kind)) {
      expect(frame.kind).toBe(FrameKind.remove);
      expect(payload.byteLength).toBe(0);
    }
  });

  it('are not taken for the other way of writing colours', () => {
    const payloadOf = (name: string) => {
      const file = readFileSync(new URL(`frames/${name}`, golden));
      return decodeTileFrame(file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength) as ArrayBuffer).payload;
    };
    const plain = payloadOf('colours.bin');
    const subtracted = payloadOf('colours_subtract_green.bin');
    expect(() => decodeJob(draco, { kind: 'colours', payload: plain, transform: 'subtract_green' })).toThrow(
      'components of COLOR',
    );
    expect(() => decodeJob(draco, { kind: 'colours', payload: subtracted, transform: 'none' })).toThrow('components of COLOR');
  });

  it('say what is wrong with a payload that is not Draco', () => {
    const payload = new Uint8Array([1, 2, 3, 4]);
    expect(() => decodeJob(draco, { kind: 'colours', payload, transform: 'none' })).toThrow('Draco');
    expect(() => decodeJob(draco, { kind: 'temperature', payload })).toThrow('no scale and offset');
    const unscaled = new Uint8Array([0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4]);
    expect(() => decodeJob(draco, { kind: 'temperature', payload: unscaled })).toThrow('no temperatures');
    expect(() => decodeJob(draco, { kind: 'geometry', payload, origin_m: [0, 0, 0] })).toThrow('not a Draco stream');
  });
});
