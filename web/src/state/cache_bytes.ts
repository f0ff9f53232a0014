/** Part of this machine's memory for decoded tiles; a browser that does not tell has as much as a tablet. */
const SHARE = 1 / 16;
const TABLET_GIB = 4;
/** The most that scene.subscribe takes. */
const MOST = 2 ** 31 - 1;

/** Bytes of decoded tiles that a machine with this much memory (navigator.deviceMemory, GiB) can hold. */
export function cacheBytes(deviceMemory_gib: number | undefined): number {
  return Math.min(MOST, Math.floor((deviceMemory_gib ?? TABLET_GIB) * 2 ** 30 * SHARE));
}
