import { describe, expect, it } from 'vitest';
import type { Scene } from '../protocol/messages';
import { Store } from './store.svelte';

describe('Silence', () => {
  it('is said of a server that has a scene: without one it says nothing by itself', () => {
    const store = new Store();
    store.link = { phase: 'open' };
    store.now = 10_000;
    store.heardAt = 7_600;
    store.scene = null;
    expect(store.silentFor_s).toBeNull();
    store.scene = { name: 'room' } as unknown as Scene;
    expect(store.silentFor_s).toBe(2.4);
  });
});
