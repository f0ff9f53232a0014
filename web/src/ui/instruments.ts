/** The controls and the sheets around the picture: a part of the program of their own, which comes when the first picture has. */

export { keepClient } from '../transport/kept_client';
export { Steering } from '../view/steering';
export { default as Gizmo } from './Gizmo.svelte';
export { default as Help } from './Help.svelte';
export { default as Markers } from './Markers.svelte';
export { default as Panel } from './Panel.svelte';
export { default as ProbeLabel } from './ProbeLabel.svelte';
export { saveScreenshot } from './screenshot';
export { default as TemperatureAxis } from './TemperatureAxis.svelte';
