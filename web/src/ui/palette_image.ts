import type { Palette } from '../protocol/messages';

const HEADER_BYTES = 54;
const images = new WeakMap<Palette, { across: string; up: string }>();

/** A palette as a picture of one pixel a colour, for CSS. The browser paints it without the page's help. */
export function paletteImage(palette: Palette, direction: 'across' | 'up'): string {
  let known = images.get(palette);
  if (known === undefined) {
    const colours = palette.colours.map((colour) => colour.map(Math.round) as [number, number, number]);
    known = { across: bitmapUrl(colours, colours.length, 1), up: bitmapUrl(colours, 1, colours.length) };
    images.set(palette, known);
  }
  return known[direction];
}

/** CSS colour of a row of the palette, 0 the coldest. */
export function paletteColour(palette: Palette, row: number): string {
  return `rgb(${(palette.colours[row] ?? [0, 0, 0]).map(Math.round).join(' ')})`;
}

/** A Windows bitmap, 24 bits a pixel; its first row is the bottom one. */
export function bitmapUrl(pixels: readonly (readonly [number, number, number])[], width: number, height: number): string {
  const rowBytes = Math.ceil((width * 3) / 4) * 4;
  const file = new Uint8Array(HEADER_BYTES + rowBytes * height);
  const view = new DataView(file.buffer);
  file.set([0x42, 0x4d]);
  view.setUint32(2, file.length, true);
  view.setUint32(10, HEADER_BYTES, true);
  view.setUint32(14, 40, true);
  view.setInt32(18, width, true);
  view.setInt32(22, height, true);
  view.setUint16(26, 1, true);
  view.setUint16(28, 24, true);
  view.setUint32(34, rowBytes * height, true);
  pixels.forEach(([red, green, blue], index) => {
    file.set([blue, green, red], HEADER_BYTES + Math.floor(index / width) * rowBytes + (index % width) * 3);
  });
  return `url(data:image/bmp;base64,${btoa(String.fromCharCode(...file))})`;
}
