import { describe, expect, it } from 'vitest';
import { keptPreferences } from './preferences.svelte';

describe('keptPreferences', () => {
  it('reads what was kept', () => {
    expect(keptPreferences('{"letterKeys":false,"scheme":"light","outline":"off","fusing":"robot"}')).toEqual({
      letterKeys: false,
      scheme: 'light',
      outline: 'off',
      fusing: 'robot',
    });
  });

  it.each([null, '', 'nonsense', 'null', '[]', '{"letterKeys":"no","scheme":"green","outline":true,"fusing":"there"}'])(
    'takes the defaults for %j',
    (text) => {
      expect(keptPreferences(text)).toEqual({ letterKeys: true, scheme: 'dark', outline: 'automatic', fusing: 'automatic' });
    },
  );
});
