/**
 * Has the browser keep the client (public/kept.js), where it can: over HTTPS and on this machine. It is told what the page has loaded, which
 * the browser then has already; nothing comes a second time over the link.
 */
export async function keepClient(): Promise<void> {
  // Not there over plain HTTP, whatever the types say.
  const workers = navigator.serviceWorker as ServiceWorkerContainer | undefined;
  if (!workers) return;
  try {
    await workers.register('./kept.js');
    const { active } = await workers.ready;
    const page = new URL('./', location.href).href;
    active?.postMessage([page, ...performance.getEntriesByType('resource').map(({ name }) => name)]);
  } catch {
    // Then it is not kept, and everything else is as it was.
  }
}
