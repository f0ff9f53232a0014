import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Coalescer } from './coalescer';

type Change = Record<string, number>;

function setUp(max_in_flight = 1, rest_ms?: number) {
  const sent: Change[] = [];
  const answers: (() => void)[] = [];
  const idle = vi.fn();
  const coalescer = new Coalescer<Change>({
    send: (change) => {
      sent.push(change);
      return new Promise<void>((resolve) => answers.push(resolve));
    },
    merge: (earlier, later) => ({ ...earlier, ...later }),
    interval_ms: 30,
    ...(rest_ms === undefined ? {} : { rest_ms }),
    max_in_flight,
    onIdle: idle,
  });
  const answer = async () => {
    answers.shift()?.();
    await vi.advanceTimersByTimeAsync(0);
  };
  return { coalescer, sent, answer, idle };
}

describe('Coalescer', () => {
  beforeEach(() => vi.useFakeTimers());
  afterEach(() => vi.useRealTimers());

  it('sends the first change at once and merges the rest until it is answered', async () => {
    const { coalescer, sent, answer } = setUp();
    coalescer.push({ alpha: 1 });
    for (let i = 2; i <= 50; i += 1) coalescer.push({ alpha: i });
    coalescer.push({ k: 3 });
    expect(sent).toEqual([{ alpha: 1 }]);
    await vi.advanceTimersByTimeAsync(1000);
    expect(sent).toHaveLength(1);
    await answer();
    expect(sent).toEqual([{ alpha: 1 }, { alpha: 50, k: 3 }]);
  });

  it('keeps the interval between sends', async () => {
    const { coalescer, sent } = setUp(100);
    for (let ms = 0; ms < 300; ms += 5) {
      coalescer.push({ alpha: ms });
      await vi.advanceTimersByTimeAsync(5);
    }
    expect(sent.length).toBeLessThanOrEqual(11);
    expect(sent.length).toBeGreaterThanOrEqual(9);
    await vi.advanceTimersByTimeAsync(30);
    expect(sent.at(-1)).toEqual({ alpha: 295 });
  });

  it('sends the first after a rest at once; others wait until changes rest, and no longer than the interval', async () => {
    const { coalescer, sent, answer } = setUp(1, 10);
    for (let ms = 0; ms < 90; ms += 5) {
      coalescer.push({ alpha: ms });
      await answer();
      await vi.advanceTimersByTimeAsync(5);
    }
    expect(sent).toEqual([{ alpha: 0 }, { alpha: 30 }, { alpha: 60 }]);
    await answer();
    await vi.advanceTimersByTimeAsync(4);
    expect(sent).toHaveLength(3);
    await vi.advanceTimersByTimeAsync(1);
    expect(sent.at(-1)).toEqual({ alpha: 85 });
    await answer();
    await vi.advanceTimersByTimeAsync(10);
    coalescer.push({ alpha: 99 });
    expect(sent.at(-1)).toEqual({ alpha: 99 });
  });

  it('does not wait for the interval when flushed', () => {
    const { coalescer, sent } = setUp(2);
    coalescer.push({ alpha: 1 });
    coalescer.push({ alpha: 2 });
    expect(sent).toHaveLength(1);
    coalescer.flush();
    expect(sent.at(-1)).toEqual({ alpha: 2 });
  });

  it('sends a flushed change as soon as the answer before it comes', async () => {
    const { coalescer, sent, answer } = setUp(1);
    coalescer.push({ alpha: 1 });
    coalescer.push({ alpha: 2 });
    coalescer.flush();
    expect(sent).toHaveLength(1);
    await answer();
    expect(sent.at(-1)).toEqual({ alpha: 2 });
  });

  it('is idle when everything has been answered, and only then', async () => {
    const { coalescer, answer, idle } = setUp();
    coalescer.push({ alpha: 1 });
    coalescer.push({ alpha: 2 });
    await answer();
    await vi.advanceTimersByTimeAsync(30);
    expect(idle).not.toHaveBeenCalled();
    expect(coalescer.busy).toBe(true);
    await answer();
    expect(idle).toHaveBeenCalledTimes(1);
    expect(coalescer.busy).toBe(false);
  });

  it('ignores answers from before a reset and hands back what was not sent', async () => {
    const { coalescer, sent, answer, idle } = setUp();
    coalescer.push({ alpha: 1 });
    coalescer.push({ alpha: 2 });
    expect(coalescer.reset()).toEqual({ alpha: 2 });
    coalescer.push({ alpha: 3 });
    expect(sent.at(-1)).toEqual({ alpha: 3 });
    await answer();
    expect(coalescer.busy).toBe(true);
    expect(idle).not.toHaveBeenCalled();
  });
});
