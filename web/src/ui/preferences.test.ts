import { describe, expect, it } from 'vitest';
import { keptPreferences } from './preferences.svelte';

describe('keptPreferences', () => {
  it('reads what was kept', () => {
    expect(keptPreferences('{"letterKeys":false,"scheme":"light","outline":"off"}')).toEqual({
      letterKeys: false,
      scheme: 'light',
      outline: 'off',
    });
  });

  it.each([null, '', 'nonsense', 'null', '[]', '{"letterKeys":"no","scheme":"green","outline":true}'])(
    'takes the defaults for %j',
    (text) => {
      expect(keptPreferences(text)).toEqual({ letterKeys: true, scheme: 'dark', outline: 'automatic' });
    },
  );
});
