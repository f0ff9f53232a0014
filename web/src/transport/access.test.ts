import { describe, expect, test } from 'vitest';
import { mustLogIn } from './access';

const answering =
  (body: unknown): typeof fetch =>
  () =>
    Promise.resolve(new Response(JSON.stringify(body)));

describe('mustLogIn', () => {
  test('is true where a token is needed and nobody is known who may watch', async () => {
    expect(await mustLogIn(answering({ needs_token: true, role: null }))).toBe(true);
    expect(await mustLogIn(answering({ needs_token: true, role: 'ingest' }))).toBe(true);
  });

  test('is false for who is known, where nobody needs a token, without a link, and for answers of something else', async () => {
    for (const role of ['viewer', 'operator', 'admin'])
      expect(await mustLogIn(answering({ needs_token: true, role }))).toBe(false);
    expect(await mustLogIn(answering({ needs_token: false, role: 'admin' }))).toBe(false);
    expect(await mustLogIn(() => Promise.reject(new TypeError('no link')))).toBe(false);
    for (const body of [null, 'captive portal', {}, []]) expect(await mustLogIn(answering(body))).toBe(false);
    expect(await mustLogIn(() => Promise.resolve(new Response('<html>')))).toBe(false);
  });
});
