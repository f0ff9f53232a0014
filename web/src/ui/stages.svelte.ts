/**
 * Counts from 0 up to `last`, one step in a task of its own each, once `isReady`. What is built step by step leaves the page free
 * for the user and the stream in between.
 */
export function stages(last: number, isReady: () => boolean): { readonly reached: number } {
  let reached = $state(0);
  $effect(() => {
    if (reached >= last || !isReady()) return;
    const timer = setTimeout(() => (reached += 1));
    return () => clearTimeout(timer);
  });
  return {
    get reached() {
      return reached;
    },
  };
}
