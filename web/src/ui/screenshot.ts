import type { Session } from '../state/session';
import { celsius, duration } from './format';

/** What is in the picture, and of when: a picture that is sent on must not be taken for what it is not. */
function captions({ store }: Session): string[] {
  const { connected, lostFor_s, methodIsPending, settingsArePending, otherMethods, methods, method, scene } = store;
  const shown = otherMethods.map((id) => methods.find((one) => one.id === id)?.label ?? id);
  const seen = new Date(Date.now() - (connected ? 0 : lostFor_s * 1000)).toISOString().replace('T', ' ').slice(0, 19);
  return [
    scene?.name ?? '',
    `${method?.label ?? ''}${methodIsPending ? `, in parts still ${shown.join(' and ')}` : settingsArePending ? ', settings of before' : ''}`,
    `${seen} UTC`,
    ...(connected ? [] : [`Link lost: ${duration(lostFor_s)} old when saved`]),
    ...(store.hatchAbove_kelvin === null ? [] : [`Hatched: less sure than ${store.hatchAbove_kelvin} °C`]),
    ...(scene?.temperature.missing_count && store.fusion?.missing !== 'visible'
      ? [`No temperature: ${store.fusion?.missing ?? ''}`]
      : []),
  ];
}

/** The picture as it is on the screen with its scale beside it, so that it can be read without the program. */
function composed(session: Session, picture: ImageBitmap): HTMLCanvasElement {
  const { store } = session;
  const canvas = document.createElement('canvas');
  canvas.width = picture.width;
  canvas.height = picture.height;
  const context = canvas.getContext('2d');
  if (context === null) throw new Error('no 2D canvas');
  context.drawImage(picture, 0, 0);
  const unit = picture.width / session.viewport.size[0];
  context.scale(unit, unit);
  const height = picture.height / unit;
  const lines = captions(session);
  context.font = '13px system-ui, sans-serif';
  const { palette, fusion } = store;
  const scaled = palette !== null && fusion?.range.min != null && store.method?.uses_palette !== false;
  const scaleHeight = Math.min(220, height * 0.4);
  const top = height - 16 - lines.length * 18 - (scaled ? scaleHeight + 34 : 0);
  const boxWidth = Math.max(...lines.map((line) => context.measureText(line).width), 90) + 24;
  context.fillStyle = 'rgb(28 29 31 / 0.85)';
  context.fillRect(8, top - 10, boxWidth, height - top);
  context.fillStyle = '#e8e8e5';
  if (scaled && fusion.range.max !== null) {
    for (let row = 0; row < scaleHeight; row += 1) {
      const colour = palette.colours[Math.round((1 - row / scaleHeight) * 255)] ?? [0, 0, 0];
      context.fillStyle = `rgb(${colour.map(Math.round).join(' ')})`;
      context.fillRect(20, top + 4 + row, 14, 1.5);
    }
    context.fillStyle = '#e8e8e5';
    context.fillText(celsius(fusion.range.max, store.decimals), 42, top + 12);
    context.fillText(celsius(fusion.range.min, store.decimals), 42, top + scaleHeight + 4);
  }
  lines.forEach((line, index) => context.fillText(line, 20, height - 16 - (lines.length - 1 - index) * 18));
  return canvas;
}

/** Saves the picture as a PNG file, or says why it does not. */
export async function saveScreenshot(session: Session): Promise<void> {
  try {
    const picture = await session.viewport.copy();
    const canvas = composed(session, picture);
    picture.close();
    const blob = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, 'image/png'));
    if (blob === null) throw new Error('The browser makes no file of this picture.');
    const address = URL.createObjectURL(blob);
    const link = document.createElement('a');
    link.href = address;
    link.download = `spectra-${new Date().toISOString().slice(0, 19).replaceAll(':', '-')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
  } catch (error) {
    session.store.failure = `Nothing was saved. ${error instanceof Error ? error.message : String(error)}`;
  }
}
