import { describe, expect, it } from 'vitest';
import { cardPlace, hasRoomForGizmo, isCramped, isNarrow, labelPlaces, narrowCardRoom } from './layout';

describe('isNarrow', () => {
  it.each([
    [360, 740, true],
    [390, 844, true],
    [820, 1180, true],
    [1180, 820, false],
    [1280, 720, false],
    [3840, 2160, false],
    [2160, 3840, false],
    [640, 360, true],
  ])('%i x %i: %s', (width, height, expected) => {
    expect(isNarrow(width, height)).toBe(expected);
  });
});

describe('isCramped', () => {
  it.each([
    [360, 740, true],
    [740, 360, true],
    [844, 390, true],
    [1000, 500, false],
    [1180, 820, false],
  ])('%i x %i: %s', (width, height, expected) => {
    expect(isCramped(width, height)).toBe(expected);
  });
});

describe('cardPlace', () => {
  const room = { left: 92, top: 0, right: 360, bottom: 400 };
  const size = { width: 180, height: 50 };

  it('stands right of the place and above it', () => {
    expect(cardPlace({ x: 120, y: 200 }, size, room)).toEqual({ left: 134, top: 136 });
  });

  it('is within the room wherever the place is', () => {
    for (let x = -50; x <= 450; x += 25) {
      for (let y = -50; y <= 450; y += 25) {
        const { left, top } = cardPlace({ x, y }, size, room);
        expect(left).toBeGreaterThanOrEqual(room.left);
        expect(left + size.width).toBeLessThanOrEqual(room.right);
        expect(top).toBeGreaterThanOrEqual(room.top);
        expect(top + size.height).toBeLessThanOrEqual(room.bottom);
      }
    }
  });

  it('stands beside or above what is kept free, if there is room', () => {
    const kept = { left: 260, top: 300, right: 360, bottom: 400 };
    expect(cardPlace({ x: 150, y: 390 }, { width: 100, height: 50 }, room, 14, kept)).toEqual({ left: 160, top: 326 });
    expect(cardPlace({ x: 300, y: 390 }, size, room, 14, kept)).toEqual({ left: 106, top: 250 });
    expect(cardPlace({ x: 230, y: 390 }, { width: 100, height: 50 }, room, 14, kept)).toEqual({ left: 160, top: 326 });
    // Nowhere: over it.
    expect(cardPlace({ x: 300, y: 390 }, { width: 250, height: 350 }, room, 14, kept)).toEqual({ left: 92, top: 26 });
  });

  it('begins at the left and the top of a room that is too small', () => {
    expect(cardPlace({ x: 100, y: 10 }, { width: 400, height: 500 }, room)).toEqual({ left: 92, top: 0 });
  });
});

describe('labelPlaces', () => {
  const room = { left: 100, top: 0, right: 500, bottom: 300 };
  const label = (x: number, y: number) => ({ x, y, width: 80, height: 20 });

  it('stands right of its place, or left of it where the room ends', () => {
    expect(labelPlaces([label(200, 100), label(480, 200)], room, 13)).toEqual([
      { left: 213, top: 90 },
      { left: 387, top: 190 },
    ]);
  });

  it('lies over no other label and over no place', () => {
    const [first, second] = labelPlaces([label(200, 100), label(250, 104)], room, 13);
    expect(first).toEqual({ left: 107, top: 90 });
    expect(second).toEqual({ left: 263, top: 94 });
  });

  it('lies not over what is kept free', () => {
    const kept = [{ left: 210, top: 80, right: 320, bottom: 120 }];
    expect(labelPlaces([label(200, 100)], room, 13, kept)).toEqual([{ left: 107, top: 90 }]);
  });

  it('is left out where there is no room', () => {
    expect(labelPlaces([label(110, 10)], { ...room, right: 150, bottom: 20 }, 13)).toEqual([null]);
  });
});

describe('hasRoomForGizmo', () => {
  it.each([
    [268, 370, null, 148, true],
    [228, 274, null, 148, true],
    [228, 260, null, 148, false],
    [548, 172, null, 76, true],
    [228, 99, null, 76, false],
    [548, 70, null, 76, false],
    // Beside a reading, below notices.
    [268, 370, 67, 148, true],
    [228, 273, 67, 148, false],
    [548, 172, 100, 76, true],
  ])('in %i x %i, with a reading and %s covered, of %i: %s', (width, height, covered, gizmo, expected) => {
    expect(hasRoomForGizmo(width, height, covered, gizmo)).toBe(expected);
  });
});

describe('narrowCardRoom', () => {
  const free = { left: 96, top: 156, right: 356, bottom: 270 };

  it('is what is free where a reading fits in', () => {
    expect(narrowCardRoom(free, 148)).toEqual(free);
  });

  it('is beside the orientation on a low page, where that is wide enough', () => {
    expect(narrowCardRoom({ ...free, right: 636, bottom: 170 }, 148)).toEqual({ left: 96, top: 4, right: 480, bottom: 170 });
  });

  it('is never narrower than a reading: then it lies over the orientation', () => {
    expect(narrowCardRoom({ ...free, bottom: 200 }, 148)).toEqual({ ...free, top: 4, bottom: 200 });
  });
});
