import { describe, expect, it } from 'vitest';
import { bitmapUrl, paletteColour, paletteImage } from './palette_image';

const bytesOf = (url: string) => Buffer.from(/base64,(.*)\)$/.exec(url)?.[1] ?? '', 'base64');

describe('paletteImage', () => {
  it('is a bitmap with the coldest colour left, or at the bottom', () => {
    const colours = Array.from({ length: 256 }, (_, i): [number, number, number] => [i, 0.4, 255 - i]);
    const palette = { id: 'x', label: '', fusion_safe: false, colours };
    const across = bytesOf(paletteImage(palette, 'across'));
    expect(across.toString('latin1', 0, 2)).toBe('BM');
    expect([across.readUInt32LE(2), across.readInt32LE(18), across.readInt32LE(22)]).toEqual([across.length, 256, 1]);
    expect([...across.subarray(54, 60)]).toEqual([255, 0, 0, 254, 0, 1]);
    const up = bytesOf(paletteImage(palette, 'up'));
    expect([up.readInt32LE(18), up.readInt32LE(22)]).toEqual([1, 256]);
    expect([...up.subarray(54, 62)]).toEqual([255, 0, 0, 0, 254, 0, 1, 0]);
    expect(paletteImage(palette, 'up')).toBe(paletteImage(palette, 'up'));
    expect(paletteColour(palette, 255)).toBe('rgb(255 0 0)');
  });

  it('pads rows to four bytes', () => {
    const file = bytesOf(
      bitmapUrl(
        [
          [1, 2, 3],
          [4, 5, 6],
        ],
        2,
        1,
      ),
    );
    expect([...file.subarray(54)]).toEqual([3, 2, 1, 6, 5, 4, 0, 0]);
  });
});
