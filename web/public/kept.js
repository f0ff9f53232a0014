// Keeps the client for when the robot does not answer: its page and assets, and nothing of a scene.
const NAME = 'spectra-client';
const PAGE = registration.scope;
const PATIENCE_MS = 4000;

const isAsset = (url) => url.startsWith(`${PAGE}assets/`);

async function keep(urls) {
  const kept = await caches.open(NAME);
  for (const url of urls) {
    if ((url !== PAGE && !isAsset(url)) || (await kept.match(url))) continue;
    const reply = await fetch(url, { redirect: 'error' });
    if (reply.ok) await kept.put(url, reply);
  }
}

async function asset(request) {
  const kept = await caches.open(NAME);
  const found = await kept.match(request.url, { ignoreVary: true });
  if (found) return found;
  const reply = await fetch(request);
  if (reply.ok) await kept.put(request.url, reply.clone());
  return reply;
}

// The robot's page; the one that is kept where it does not come, or comes late: then it takes over.
async function page(event) {
  const found = await (await caches.open(NAME)).match(PAGE);
  let isLate = false;
  const coming = fetch(event.request).then(async (reply) => {
    if (!reply.ok && reply.type !== 'opaqueredirect') return reply;
    const text = reply.ok ? await reply.clone().text() : null;
    if (found && text === (await found.clone().text())) return reply;
    await caches.delete(NAME);
    if (reply.ok) await (await caches.open(NAME)).put(PAGE, reply.clone());
    if (isLate) for (const client of await clients.matchAll()) await client.navigate(client.url);
    return reply;
  });
  if (!found) return coming;
  const instead = () => ((isLate = true), found.clone());
  event.waitUntil(coming.catch(() => {}));
  return Promise.race([coming.catch(instead), new Promise((resolve) => setTimeout(() => resolve(instead()), PATIENCE_MS))]);
}

addEventListener('install', () => skipWaiting());
addEventListener('message', (event) => event.waitUntil(keep(event.data).catch(() => {})));
addEventListener('fetch', (event) => {
  const { method, url } = event.request;
  if (method !== 'GET') return;
  if (url === PAGE) event.respondWith(page(event));
  else if (isAsset(url)) event.respondWith(asset(event.request));
});
