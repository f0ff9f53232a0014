import { beforeEach, describe, expect, it } from 'vitest';
import type { DecodeResult } from '../decode/messages';
import { FrameKind } from '../protocol/frame';
import { FrameIntake } from './frame_intake';
import { decodedGeometry, ROOT, tileFrame } from './test_tiles';
import { TileSet } from './tile_set';

const COMPLETE = { generation: 1, scene_revision: 1, tiles: 1, vertices: 1 };

const results: Record<DecodeResult['kind'], DecodeResult> = {
  visible: { kind: 'visible', rgb: new Uint8Array(3) },
  temperature: { kind: 'temperature', codes: new Uint16Array(1), scale: 1, offset: 0 },
  sigma: { kind: 'sigma', codes: new Uint16Array(1), scale: 1, offset: 0 },
  geometry: decodedGeometry(),
  colours: { kind: 'colours', rgba: new Uint8Array(4) },
};

let decodings: { finish: () => Promise<void>; fail: () => Promise<void> }[];
let arrivalCount = 0;
let acknowledged: number[];
let problems: unknown[];
let rawProblems: string[];
let wholes: Uint8Array[];
let tiles: TileSet;
let intake: FrameIntake;
let sequence: number;

function receive(kind: number): void {
  sequence += 1;
  intake.receive(tileFrame(ROOT, { kind, sequence }));
}
const picture = () => intake.bringIn(performance.now());
const settle = () => new Promise<void>((resolve) => setTimeout(resolve));

beforeEach(() => {
  decodings = [];
  acknowledged = [];
  problems = [];
  rawProblems = [];
  wholes = [];
  sequence = 0;
  tiles = new TileSet(() => ({
    setColours: () => undefined,
    setRaw: () => undefined,
    setSigma: () => undefined,
    setVisible: () => undefined,
    dispose: () => undefined,
  }));
  intake = new FrameIntake(
    tiles,
    {
      decode: (_key, { kind }) =>
        new Promise((resolve, reject) =>
          decodings.push({
            finish: () => {
              resolve(results[kind]);
              return settle();
            },
            fail: () => {
              reject(new Error('broken'));
              return settle();
            },
          }),
        ),
      clear: () => undefined,
      dispose: () => undefined,
    },
    {
      onDecoded: (last) => acknowledged.push(last),
      onArrival: () => {
        arrivalCount += 1;
      },
      onWholeColours: (rgba) => wholes.push(rgba),
      onProblem: (error) => problems.push(error),
      onRawProblem: (message) => rawProblems.push(message),
    },
  );
  intake.beginConnection();
});

describe('FrameIntake', () => {
  it('acknowledges what is decoded, whatever the order', async () => {
    receive(FrameKind.geometry);
    receive(FrameKind.colours);
    await decodings[1]?.finish();
    expect(acknowledged).toEqual([]);
    await decodings[0]?.finish();
    expect(acknowledged).toEqual([2]);
    picture();
    expect(tiles.size).toBe(1);
  });

  it('tells of colours of the whole scene, not of those of a part', async () => {
    receive(FrameKind.colours);
    await decodings[0]?.finish();
    expect(wholes).toHaveLength(1);
    intake.receive(tileFrame({ level: 1, x: 0, y: 0, z: 0 }, { kind: FrameKind.colours, sequence: 2 }));
    await decodings[1]?.finish();
    expect(wholes).toHaveLength(1);
    // Of a scene that has shrunk another tile is the first.
    intake.receive(tileFrame({ level: 0, x: 0, y: 0, z: 0 }, { kind: FrameKind.remove, sequence: 3 }));
    intake.receive(tileFrame({ level: 7, x: 9, y: 9, z: 9 }, { kind: FrameKind.colours, sequence: 4 }));
    await decodings[2]?.finish();
    expect(wholes).toHaveLength(2);
  });

  it('is complete once everything before is in the picture, and once only', async () => {
    receive(FrameKind.geometry);
    receive(FrameKind.colours);
    intake.completeAfterAll(COMPLETE);
    await decodings[0]?.finish();
    expect(picture().complete).toBeNull();
    await decodings[1]?.finish();
    expect(picture().complete).toEqual(COMPLETE);
    expect(picture().complete).toBeNull();
  });

  it('shows a revision once everything before is in the picture, whatever comes after', async () => {
    receive(FrameKind.geometry);
    const before = arrivalCount;
    intake.shownAfterAll({ generation: 1, scene_revision: 4 });
    // That alone is no reason for another picture.
    expect(arrivalCount).toBe(before);
    receive(FrameKind.colours);
    intake.shownAfterAll({ generation: 1, scene_revision: 5 });
    receive(FrameKind.colours);
    await decodings[2]?.finish();
    expect(picture().shown).toBeNull();
    await decodings[0]?.finish();
    expect(picture().shown?.scene_revision).toBe(4);
    expect(picture().shown).toBeNull();
    await decodings[1]?.finish();
    expect(picture().shown?.scene_revision).toBe(5);
    // Of what nothing has been drawn in between, the oldest and the newest count.
    for (const scene_revision of [6, 7, 8, 9]) {
      intake.shownAfterAll({ generation: 1, scene_revision });
      receive(FrameKind.colours);
    }
    await decodings[3]?.finish();
    expect(picture().shown?.scene_revision).toBe(6);
    for (const decoding of decodings.slice(4)) await decoding?.finish();
    expect(picture().shown?.scene_revision).toBe(9);
    intake.shownAfterAll({ generation: 1, scene_revision: 10 });
    intake.beginConnection();
    expect(picture().shown).toBeNull();
  });

  it('leaves out what was sent of a tile before it was removed', async () => {
    receive(FrameKind.geometry);
    receive(FrameKind.colours);
    receive(FrameKind.remove);
    await decodings[0]?.finish();
    await decodings[1]?.finish();
    picture();
    expect(tiles.size).toBe(0);
    expect(acknowledged.at(-1)).toBe(3);
  });

  it('forgets what an earlier connection has left in the decoder', async () => {
    receive(FrameKind.geometry);
    intake.completeAfterAll(COMPLETE);
    intake.beginConnection();
    await decodings[0]?.finish();
    expect(picture()).toEqual({ bytes: 0, next_ms: null, complete: null, shown: null });
    expect(acknowledged).toEqual([]);
    expect(tiles.size).toBe(0);
  });

  it('tells of a frame that cannot be decoded, and goes on', async () => {
    receive(FrameKind.geometry);
    await decodings[0]?.fail();
    expect(problems).toEqual([new Error('broken')]);
    expect(acknowledged).toEqual([1]);
  });

  it.each(['temperature', 'visible', 'visible_subtract_green'] as const)(
    'tells of a raw layer (%s) that cannot be decoded what it tells of one that does not fit, and of nothing else',
    async (kind) => {
      receive(FrameKind[kind]);
      expect(intake.isTakenIn).toBe(false);
      await decodings[0]?.fail();
      expect(rawProblems).toEqual(['tile 0/0/0/0: broken']);
      sequence += 1;
      intake.receive(tileFrame(ROOT, { kind: FrameKind[kind], sequence, vertex_count: 2 }));
      await decodings[1]?.finish();
      picture();
      expect(rawProblems[1]).toMatch(/^tile 0\/0\/0\/0: a raw layer of \d vertices for a geometry of \d/);
      expect(problems).toEqual([]);
      expect(intake.isTakenIn).toBe(true);
    },
  );

  it('acknowledges kinds that it does not know', () => {
    receive(200);
    expect(acknowledged).toEqual([1]);
  });
});
