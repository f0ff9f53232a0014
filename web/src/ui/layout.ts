/** Where the controls leave room, and how a card keeps within it. All in CSS pixels of the page. */

export interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

const isTouched = typeof matchMedia === 'function' && matchMedia('(pointer: coarse)').matches;

/** Width and height of the orientation gizmo: under a finger every ball is 44 px wide, and the whole so large that they stand apart. */
export const GIZMO_SIZE = isTouched ? 148 : 76;

/** Height of the status bar, which may hold a button; app.css has the same. */
export const BAR_HEIGHT = isTouched ? 45 : 30;

/** The panel becomes a sheet below the scene where it would leave too little beside it: phones, and tablets held upright. */
export function isNarrow(width: number, height: number): boolean {
  return width < 720 || (width < 1100 && height > width);
}

/** Too small for controls: the scene and how old it is are all there is room for. */
export function isTiny(width: number, height: number): boolean {
  return width < 280 || height < 220;
}

/** Width of the axis: numbers of the scale, the strip, and the same numbers with a word where it is not narrow, beside each other. */
export function axisWidthFor(numbers: readonly string[], isNarrow: boolean): number {
  const longest = Math.max(...numbers.map(({ length }) => length));
  return isNarrow ? 92 + 15 * Math.max(0, longest - 5) : 164 + 15 * Math.max(0, longest - 7);
}

/** How much larger the controls are on a screen of very many pixels; app.css has the same bound. */
export function controlZoom(width: number): number {
  return width >= 2800 ? 1.5 : 1;
}

/** So little is left of the scene that only one thing has room over it: a phone, and a page that is hardly higher than one lying down. */
export function isCramped(width: number, height: number): boolean {
  return isNarrow(width, height) || height < 480;
}

/**
 * Left and top of a card of `size` beside a `place`: right of it and above, where that is within `room`, else mirrored, and in any
 * case pushed inside; beside or above what is `kept` free, a corner of the room at its right and its bottom, if the room has place there.
 */
export function cardPlace(
  place: { x: number; y: number },
  size: { width: number; height: number },
  room: Box,
  gap = 14,
  kept: Box | null = null,
): { left: number; top: number } {
  const right = place.x + gap;
  const above = place.y - gap - size.height;
  const left = right + size.width <= room.right ? right : place.x - gap - size.width;
  const top = above >= room.top ? above : place.y + gap;
  const within = (x: number, y: number) => ({
    left: clamp(x, room.left, room.right - size.width),
    top: clamp(y, room.top, room.bottom - size.height),
  });
  const usual = within(left, top);
  if (kept === null) return usual;
  const isFree = (at: { left: number; top: number }) =>
    !overlap({ ...at, right: at.left + size.width, bottom: at.top + size.height }, kept);
  const others = [within(kept.left - size.width, top), within(left, kept.top - size.height)];
  return [usual, ...others].find(isFree) ?? usual;
}

/** Least width of a notice that stands beside the orientation. */
export const LEAST_NOTICE_WIDTH = 240;
/** Least height of one that stands below it, with its margins. */
const LEAST_NOTICE_HEIGHT = 122;

/** Least size of a reading. */
const CARD = { width: 200, height: 80 };

/**
 * Whether the scene of a narrow page, this wide and high, has room for the orientation and for a notice below or beside it; where there
 * is a reading, for that as well, while notices cover `covered` of the height.
 */
export function hasRoomForGizmo(width: number, height: number, covered: number | null = null, gizmo = GIZMO_SIZE): boolean {
  const hasNotice = height >= gizmo + LEAST_NOTICE_HEIGHT || (width >= gizmo + LEAST_NOTICE_WIDTH && height >= gizmo);
  const hasCard = covered === null || height - covered >= gizmo + CARD.height + 16 || width >= gizmo + CARD.width + 16;
  return hasNotice && hasCard;
}

/**
 * Where a card may stand on a narrow page, in `free`, which lies below the orientation: where that is too low, beside the orientation, and
 * where there is too little of that as well, over it.
 */
export function narrowCardRoom(free: Box, gizmo = GIZMO_SIZE): Box {
  if (free.bottom - free.top >= CARD.height) return free;
  const right = free.right - gizmo - 8;
  return { ...free, top: 4, right: right - free.left >= CARD.width ? right : free.right };
}

/** `low` wins where the two contradict each other. */
function clamp(value: number, low: number, high: number): number {
  return Math.max(low, Math.min(high, value));
}

/**
 * Left and top of labels beside their places, in order: right, left, above or below, wherever a label is within `room` and lies over
 * none that has been set before, nor over what is `kept` free; null where there is no such place.
 */
export function labelPlaces(
  labels: readonly { x: number; y: number; width: number; height: number }[],
  room: Box,
  gap: number,
  kept: readonly Box[] = [],
): ({ left: number; top: number } | null)[] {
  const taken: Box[] = [
    ...kept,
    ...labels.map(({ x, y }) => ({ left: x - gap / 2, top: y - gap / 2, right: x + gap / 2, bottom: y + gap / 2 })),
  ];
  return labels.map(({ x, y, width, height }) => {
    const sides = [
      { left: x + gap, top: y - height / 2 },
      { left: x - gap - width, top: y - height / 2 },
      { left: x - width / 2, top: y - gap - height },
      { left: x - width / 2, top: y + gap },
    ];
    const free = sides.find(({ left, top }) => {
      const box = { left, top, right: left + width, bottom: top + height };
      return isWithin(box, room) && !taken.some((other) => overlap(box, other));
    });
    if (free === undefined) return null;
    taken.push({ ...free, right: free.left + width, bottom: free.top + height });
    return free;
  });
}

function isWithin(box: Box, room: Box): boolean {
  return box.left >= room.left && box.top >= room.top && box.right <= room.right && box.bottom <= room.bottom;
}

function overlap(a: Box, b: Box): boolean {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}
