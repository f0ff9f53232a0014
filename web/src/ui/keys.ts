import type { Session } from '../state/session';
import type { ViewMode } from '../state/store.svelte';
import { preferences } from './preferences.svelte';

const VIEWS: Record<string, ViewMode> = { '1': 'thermal', '2': 'visible', '3': 'fused' };
const TURN_RAD = Math.PI / 36;
const STEP = 0.06;

/** One line of the help sheet. */
export const KEYS: readonly (readonly [string, string])[] = [
  ['1', 'Thermal'],
  ['2', 'Visible'],
  ['3', 'Fused, with the last method used'],
  ['F', 'Fit the scene into the window'],
  ['R', 'Back to the first view'],
  ['G', 'Go along with the robot, where one maps the scene'],
  ['L', 'Lock the temperature range, or let it follow the scene'],
  ['E', 'Range to the extremes of the scene, or to all but the outermost temperatures'],
  ['H', 'Hide the controls, or show them'],
  ['P', 'Read the temperature under the pointer, or at the mark in the middle'],
  ['S', 'Save a screenshot'],
  ['← → ↑ ↓', 'Turn; with Shift: move'],
  ['+ −', 'Nearer, farther'],
  ['Esc', 'Close'],
  ['?', 'This list'],
];

interface KeyActions {
  probe: () => void;
  screenshot: () => void;
  /** The scene has the focus: keys act there even where single keys are switched off. */
  onScene: boolean;
  /** The scene, or nothing, has the focus: arrow keys are the camera's. */
  onCanvas: boolean;
}

function isTyping(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  return target instanceof HTMLInputElement
    ? !['range', 'checkbox', 'radio'].includes(target.type)
    : target instanceof HTMLSelectElement;
}

/** The keyboard of the instrument. */
export function handleKey(event: KeyboardEvent, session: Session, actions: KeyActions): void {
  if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
  const { store } = session;
  // A dialog has the keyboard for itself.
  if (store.helpOpen) return;
  if (!preferences.letterKeys && event.key.length === 1 && !actions.onScene) return;
  const view = VIEWS[event.key];
  // What the panel does not offer.
  if (view !== undefined && view !== 'visible' && !store.hasThermal) return;
  if (view !== undefined) session.settings.setViewMode(view);
  else if (event.key === '?') store.helpOpen = true;
  else if (event.key === 'Escape') session.unpin();
  else if (event.key.toLowerCase() === 'f') session.fitView('fit');
  else if (event.key.toLowerCase() === 'r') session.fitView('reset');
  else if (event.key.toLowerCase() === 'g') session.followRobot(!store.followsRobot);
  else if (event.key.toLowerCase() === 'l') session.settings.toggleRangeLock();
  else if (event.key.toLowerCase() === 'e') session.settings.toggleRangeExtremes();
  else if (event.key.toLowerCase() === 'h') store.panelsHidden = !store.panelsHidden;
  else if (event.key.toLowerCase() === 'p') actions.probe();
  else if (event.key.toLowerCase() === 's') actions.screenshot();
  else if (!actions.onCanvas || !moveCamera(event, session)) return;
  event.preventDefault();
}

function moveCamera(event: KeyboardEvent, session: Session): boolean {
  const { viewport } = session;
  const directions: Record<string, [number, number]> = {
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
    ArrowUp: [0, -1],
    ArrowDown: [0, 1],
  };
  const direction = directions[event.key];
  if (direction !== undefined) {
    if (event.shiftKey) viewport.move(direction[0] * STEP, direction[1] * STEP);
    else viewport.turn(-direction[0] * TURN_RAD, direction[1] * TURN_RAD);
    return true;
  }
  if (event.key === '+' || event.key === '=') viewport.approach(0.15);
  else if (event.key === '-') viewport.approach(-0.18);
  else return false;
  return true;
}
