import { render } from 'svelte/server';
import { describe, expect, it } from 'vitest';
import type { Fusion, Scene, StreamComplete } from '../protocol/messages';
import type { Session } from '../state/session';
import { Store } from '../state/store.svelte';
import StateNotice from './StateNotice.svelte';
import StatusBar from './StatusBar.svelte';

function connected(): Store {
  const store = new Store();
  store.link = { phase: 'open' };
  store.now = 10_000;
  return store;
}

/** The words alone. */
const text = (html: string) => html.replace(/<!--.*?-->|<[^>]*>/g, '').replace(/\s+/g, ' ');

describe('What the status bar says of the picture', () => {
  const age = (store: Store) => text(render(StatusBar, { props: { store, narrow: false, tiny: false } }).body).trim();

  it('is that there is no scene, also after one', () => {
    const store = connected();
    expect(age(store)).toMatch(/loading$/);
    store.scene = null;
    expect(age(store)).toMatch(/no scene yet$/);
    store.complete = {} as StreamComplete;
    expect(age(store)).toMatch(/no scene yet$/);
  });
});

describe('The range that has moved', () => {
  const RANGE = { mode: 'percentile', min: 12, max: 34, low: 1, high: 99 } as const;
  const notice = (store: Store) =>
    text(
      render(StateNotice, {
        props: {
          store,
          session: {} as Session,
          retryPart: () => undefined,
          narrow: false,
          tiny: false,
          cramped: false,
          hasGizmo: true,
          announcedAt: store.now - 100,
          room: { left: 0, top: 0, right: 1000, bottom: 700 },
        },
      }).body,
    );

  it('is named as it is in force while another one that follows the scene is asked for, and not while it is held', () => {
    const store = connected();
    store.scene = { temperature: { min: 1, max: 99 }, vertex_count: 3, notes: [] } as unknown as Scene;
    store.fusionInForce = { method: 'blend', range: RANGE } as unknown as Fusion;
    store.complete = {} as StreamComplete;
    expect(notice(store)).toMatch(/Range now 12\.0 to 34\.0/);
    store.wanted = { range: { mode: 'auto' } };
    expect(notice(store)).toMatch(/Range now 12\.0 to 34\.0/);
    store.wanted = { range: { mode: 'manual', min: 15, max: 30 } };
    expect(notice(store)).not.toMatch(/Range now/);
  });
});
