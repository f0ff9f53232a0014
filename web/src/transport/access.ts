/** Whether the server answers, and lets nobody in who shows no token, and does not know who this is. */
export async function mustLogIn(ask: typeof fetch = fetch): Promise<boolean> {
  try {
    const reply = await ask('./api/v1/session', { cache: 'no-store' });
    const session: unknown = await reply.json();
    if (typeof session !== 'object' || session === null || !('needs_token' in session) || !('role' in session)) return false;
    return session.needs_token === true && (session.role === null || session.role === 'ingest');
  } catch {
    return false; // no link, which the status says
  }
}
