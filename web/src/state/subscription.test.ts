import { readFileSync } from 'node:fs';
import { beforeEach, describe, expect, it, vi } from 'vitest';
import { decodeServerMessage, type Hello, hello, type Scene } from '../protocol/messages';
import type { HeldLayers } from '../tiles/tile_set';
import { Store } from './store.svelte';
import { Subscription } from './subscription';

function greeting(name: string): Hello {
  const text = readFileSync(new URL(`../../../protocol/golden/messages/${name}.notification.json`, import.meta.url), 'utf8');
  const message = decodeServerMessage(text);
  if (message.type !== 'notification') throw new Error(`${name} is no notification`);
  return hello(message.params, 'hello');
}
const HELLO = greeting('hello');
const BRIEF = greeting('hello.brief');
const WITHOUT_SCENE = greeting('hello.no_scene');

const later = () => new Promise((resolve) => setTimeout(resolve));

/** A subscription, and a diary of what it does to those whom it concerns. */
function setUp() {
  const store = new Store();
  const diary: string[] = [];
  const note =
    <Result>(what: string, result: Result) =>
    () => {
      diary.push(what);
      return result;
    };
  const before = { fusion: null as object | null, quality: null as object | null };
  const claims = ['0/0/0'] as never[];
  const layers: HeldLayers = { raw: [], temperature_sigma: [], colours: [] };
  const layersOf = vi.fn(() => structuredClone(layers));
  const asked: { method: string; params: Record<string, unknown>; answer: (result: object) => Promise<void> }[] = [];
  let settle: () => void = () => undefined;
  const sent = { wait: false };
  const concerned = {
    tiles: { size: 0, clear: note('tiles cleared', undefined), layersOf, claims: vi.fn(() => claims), resume: vi.fn() },
    intake: { beginConnection: note('intake begins', undefined) },
    settings: {
      greeted: () => before.fusion as never,
      send: () => {
        diary.push('settings sent');
        return sent.wait ? new Promise<void>((resolve) => (settle = resolve)) : Promise.resolve();
      },
      busy: false,
      reconsiderMissing: vi.fn(),
    },
    quality: {
      greeted: () => before.quality as never,
      send: note('quality sent', Promise.resolve()),
      askMarks: note('marks asked', undefined),
      sceneHasStep: vi.fn(),
    },
    readings: {
      beginConnection: () => undefined,
      clear: note('readings cleared', undefined),
      askFacts: note('facts asked', undefined),
    },
    progress: { begin: vi.fn() },
    look: { sceneIs: vi.fn() },
    catalogue: { want: vi.fn(), wantNone: vi.fn() },
    fusing: { greeted: vi.fn(), sceneGone: vi.fn(), channels: ['fused'], step_celsius: undefined as number | undefined },
  };
  const subscription = new Subscription(store, 'ws://robot:8080/ws?hello=brief', concerned, {
    request: (method, params) =>
      new Promise((resolve) => {
        diary.push(method);
        asked.push({
          method,
          params: params as Record<string, unknown>,
          answer: async (result) => {
            resolve(result);
            await later();
          },
        });
      }),
    tellCamera: note('camera told', undefined),
    invalidate: () => undefined,
    onProblem: (error) => diary.push(String(error)),
  });
  return {
    store,
    subscription,
    concerned,
    claims,
    layers,
    diary,
    asked,
    before,
    sent,
    settle: () => settle(),
    lastSettle: () => settle,
  };
}

beforeEach(() => vi.restoreAllMocks());

describe('a subscription', () => {
  it('asks for the stream last, with what the server is able to', async () => {
    const { store, subscription, diary, asked, concerned } = setUp();
    subscription.greeted(HELLO);
    await later();
    expect(diary).toEqual(['intake begins', 'facts asked', 'camera told', 'marks asked', 'scene.subscribe']);
    const { params } = asked[0]!;
    expect(params['channels']).toEqual(['fused']);
    expect(params['colour_transform']).toBe(HELLO.capabilities.includes('subtract_green') ? 'subtract_green' : undefined);
    expect(params['resume']).toBeUndefined();
    expect(store.scene).toEqual(HELLO.scene);
    expect(store.methods.length).toBeGreaterThan(0);
    expect(concerned.look.sceneIs).toHaveBeenCalledWith(HELLO.scene);
    expect(concerned.progress.begin).toHaveBeenCalled();
  });

  it('knows of which scene a picture is that begins, and of none that an earlier connection has left', () => {
    const { store, subscription, concerned } = setUp();
    const { revision } = HELLO.scene!;
    subscription.greeted(HELLO);
    expect([store.isOfOldScene, store.pictureRevision]).toEqual([false, revision]);
    concerned.tiles.size = 3;
    subscription.sceneChanged({ ...HELLO.scene!, revision: revision + 1 });
    expect(store.isOfOldScene).toBe(true);
    store.pictureRevision = revision + 1;
    expect(store.isOfOldScene).toBe(false);
    subscription.greeted(HELLO);
    expect(store.isOfOldScene).toBe(true);
  });

  it('knows by what is on the screen which method an earlier connection has left there', () => {
    const { store, subscription } = setUp();
    subscription.greeted(HELLO);
    expect(store.pictureMethod).toBeNull();
    store.shownMethods = [HELLO.fusion.method];
    subscription.greeted(HELLO);
    expect(store.pictureMethod).toBe(HELLO.fusion.method);
    store.pictureMethod = null;
    store.fusionInForce = HELLO.fusion;
    store.shownMethods = [HELLO.fusion.method, 'other'];
    subscription.greeted(HELLO);
    expect(store.pictureMethod).toBe('other');
  });

  it('asks how sure temperatures are while that is hatched, of a server that knows', async () => {
    const { store, subscription, asked } = setUp();
    const able = { ...HELLO, capabilities: [...HELLO.capabilities, 'temperature_sigma'] };
    store.hatchAbove_kelvin = 0.5;
    subscription.greeted({ ...HELLO, capabilities: HELLO.capabilities.filter((one) => one !== 'temperature_sigma') });
    subscription.greeted(able);
    await later();
    store.hatchAbove_kelvin = null;
    void subscription.channelsChanged();
    expect(asked.map(({ params }) => params['channels'])).toEqual([['fused', 'temperature_sigma'], ['fused']]);
  });

  it('leaves methods and palettes until the link is free, and gets them at once when it comes back', () => {
    const { store, subscription, concerned } = setUp();
    subscription.greeted(BRIEF);
    expect(concerned.catalogue.want).not.toHaveBeenCalled();
    expect(store.isLinkFree).toBe(false);
    subscription.linkIsFree();
    subscription.linkIsFree();
    expect(store.isLinkFree).toBe(true);
    expect(concerned.catalogue.want.mock.calls).toEqual([[expect.stringMatching(/^http:\/\/robot:8080\/.*catalogue/)]]);
    subscription.greeted(BRIEF);
    expect(concerned.catalogue.want).toHaveBeenCalledTimes(2);
  });

  it('gets everything at once where there is no scene', () => {
    const { store, subscription, diary } = setUp();
    subscription.greeted(WITHOUT_SCENE);
    expect(store.isLinkFree).toBe(true);
    expect(store.scene).toBeNull();
    expect(diary).toContain('tiles cleared');
    expect(diary).toContain('readings cleared');
  });

  it('is behind of nothing without a scene, and knows that before anything else is asked for', () => {
    const { store, subscription, concerned } = setUp();
    const scenes: unknown[] = [];
    concerned.progress.begin.mockImplementation(() => scenes.push(store.scene));
    subscription.greeted(HELLO);
    subscription.sceneChanged(null);
    subscription.greeted(WITHOUT_SCENE);
    expect(scenes).toEqual([HELLO.scene, null, null]);
  });

  it('claims what it holds of the session before, once that has been subscribed to', async () => {
    const { subscription, asked, concerned } = setUp();
    const able = { ...HELLO, capabilities: [...HELLO.capabilities, 'resume'] };
    subscription.greeted(able);
    await later();
    await asked[0]!.answer({ resumed_tiles: 0 });
    const nothing = { raw: [], temperature_sigma: [], colours: [] };
    expect(concerned.tiles.resume).toHaveBeenLastCalledWith([], false, nothing, { places: [], generation: 0 });
    subscription.greeted({ ...able, session_id: 'another' });
    await later();
    expect(asked[1]!.params['resume']).toEqual({ session_id: HELLO.session_id, tiles: ['0/0/0'], ...nothing });
    await asked[1]!.answer({ resumed_tiles: 1, current_colours: [0], generation: 3 });
    expect(concerned.tiles.resume).toHaveBeenLastCalledWith(['0/0/0'], true, nothing, { places: [0], generation: 3 });
  });

  it('says of claims what layers it holds, raw ones where they are given, and of no more than a message may tell', async () => {
    const { subscription, asked, concerned, claims, layers } = setUp();
    Object.assign(layers, { raw: [0], temperature_sigma: [0], colours: [[0, 17]] });
    const able = { ...HELLO, capabilities: ['resume'] };
    subscription.greeted(able);
    await later();
    await asked[0]!.answer({});
    subscription.greeted(able);
    await later();
    expect(asked[1]!.params['resume']).toMatchObject({ raw: [], temperature_sigma: [0], colours: [[0, 17]] });
    await asked[1]!.answer({ resumed_tiles: 1 });
    while (claims.length < 900) claims.push('0/0/0' as never);
    concerned.fusing.step_celsius = 0.002;
    subscription.greeted({ ...able, capabilities: ['resume', 'raw_layers'] });
    await later();
    expect(asked[2]!.params['resume']).toMatchObject({ raw: [0] });
    expect(asked.map(({ params }) => params['temperature_step_celsius'])).toEqual([undefined, undefined, 0.002]);
    expect(concerned.tiles.claims).toHaveBeenLastCalledWith(1500, 9900);
    expect(concerned.tiles.layersOf).toHaveBeenLastCalledWith(claims, 9900 - 6 * 900, 0.002);
  });

  it("asks for the stream right behind the user's settings, and not at all when that connection is gone", async () => {
    const { subscription, diary, asked, before, sent, settle, lastSettle, store } = setUp();
    subscription.greeted(HELLO);
    await later();
    before.fusion = { method: 'blend' };
    before.quality = {};
    sent.wait = true;
    store.wanted = { method: 'blend' };
    diary.length = 0;
    subscription.greeted(HELLO);
    expect(diary.slice(-3)).toEqual(['settings sent', 'quality sent', 'marks asked']);
    await later();
    expect(diary.at(-1)).toBe('scene.subscribe');
    expect(asked).toHaveLength(2);
    expect(store.wanted).not.toBeNull();
    const settleOfSecond = lastSettle();
    subscription.greeted(HELLO);
    subscription.greeted(HELLO);
    await later();
    expect(asked).toHaveLength(3);
    settleOfSecond();
    await later();
    expect(store.wanted).not.toBeNull();
    settle();
    await later();
    expect(store.wanted).toBeNull();
    expect(asked).toHaveLength(3);
  });

  it('keeps tiles of the same scene on a new connection, and none of another one', () => {
    const { subscription, diary, concerned } = setUp();
    const cleared = () => diary.filter((what) => what === 'tiles cleared').length;
    subscription.greeted(HELLO);
    subscription.greeted(HELLO);
    expect(cleared()).toBe(0);
    expect(concerned.fusing.sceneGone).not.toHaveBeenCalled();
    subscription.greeted({ ...HELLO, scene: { ...HELLO.scene!, name: 'another' } });
    expect(cleared()).toBe(1);
    expect(concerned.fusing.sceneGone).toHaveBeenCalledOnce();
    // A running connection says itself what goes.
    subscription.sceneChanged({ ...HELLO.scene!, name: 'a third' } as Scene);
    expect(cleared()).toBe(1);
  });

  it('says that there is no scene before the connection goes on with colours that are made here', () => {
    const { subscription, concerned } = setUp();
    const { greeted, sceneGone } = concerned.fusing;
    subscription.greeted(HELLO);
    expect(sceneGone).not.toHaveBeenCalled();
    subscription.greeted(WITHOUT_SCENE);
    expect(sceneGone.mock.invocationCallOrder[0]).toBeLessThan(greeted.mock.invocationCallOrder[1]!);
    subscription.sceneChanged(HELLO.scene);
    expect(concerned.settings.reconsiderMissing).toHaveBeenCalledTimes(3);
  });

  it('forgets what is pinned in another scene, and not while the same one grows', () => {
    const { store, subscription, concerned } = setUp();
    subscription.greeted(HELLO);
    const pinned = { reading: {} as never, place: null };
    store.pinned = pinned;
    subscription.sceneChanged({ ...HELLO.scene!, revision: 2, position_step_m: 0.5 } as Scene);
    expect(store.pinned).toEqual(pinned);
    expect(concerned.quality.sceneHasStep).toHaveBeenLastCalledWith(0.5);
    subscription.sceneChanged({ ...HELLO.scene!, name: 'another' } as Scene);
    expect(store.pinned).toBeNull();
  });
});
