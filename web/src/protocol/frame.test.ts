import { describe, expect, it } from 'vitest';
import { childTile, decodeTileFrame, parentTile } from './frame';
import { FRAME_MAGIC } from './generated_frame';

function frame(change: (view: DataView) => void, size = 76): ArrayBuffer {
  const buffer = new ArrayBuffer(size);
  const view = new DataView(buffer);
  view.setUint32(0, FRAME_MAGIC, true);
  view.setUint8(4, 2);
  view.setUint16(6, 72, true);
  view.setUint32(68, Math.max(0, size - 72), true);
  change(view);
  return buffer;
}

describe('TileFrame', () => {
  it('skips to the payload of a larger header', () => {
    const decoded = decodeTileFrame(
      frame((view) => {
        view.setUint16(6, 75, true);
        view.setUint32(68, 1, true);
        view.setUint8(75, 99);
      }),
    );
    expect([...decoded.payload]).toEqual([99]);
  });

  it('reads the errors of colour and temperature where the header has them', () => {
    const long = decodeTileFrame(
      frame((view) => {
        view.setUint16(6, 80, true);
        view.setUint32(68, 4, true);
        view.setFloat32(72, 3.5, true);
        view.setFloat32(76, 0.25, true);
      }, 84),
    );
    expect([long.colour_error_levels, long.temperature_error_celsius]).toEqual([3.5, 0.25]);
    const short = decodeTileFrame(frame(() => undefined));
    expect([short.colour_error_levels, short.temperature_error_celsius]).toEqual([Number.NaN, Number.NaN]);
  });

  it('keeps an unknown kind for the caller to ignore', () => {
    expect(decodeTileFrame(frame((view) => view.setUint8(4, 77))).kind).toBe(77);
  });

  it.each([
    ['too short', () => new ArrayBuffer(71)],
    ['magic', () => frame((view) => view.setUint32(0, 1, true))],
    ['header size 71', () => frame((view) => view.setUint16(6, 71, true))],
    ['header size 77', () => frame((view) => view.setUint16(6, 77, true))],
    ['payload', () => frame((view) => view.setUint32(68, 5, true))],
  ])('refuses what is not one: %s', (_name, make) => {
    expect(() => decodeTileFrame(make())).toThrow('tile frame');
  });

  it('knows parents and children', () => {
    const parent = { level: 1, x: 1, y: 0, z: 1 };
    for (let octant = 0; octant < 8; octant += 1) expect(parentTile(childTile(parent, octant))).toEqual(parent);
    expect(childTile(parent, 6)).toEqual({ level: 2, x: 2, y: 1, z: 3 });
    expect(parentTile({ level: 0, x: 0, y: 0, z: 0 })).toBeNull();
  });
});
