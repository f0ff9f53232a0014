import { describe, expect, it } from 'vitest';
import { keptPreferences } from './preferences.svelte';

describe('keptPreferences', () => {
  it('reads what was kept', () => {
    expect(keptPreferences('{"letterKeys":false,"scheme":"light"}')).toEqual({ letterKeys: false, scheme: 'light' });
  });

  it.each([null, '', 'nonsense', 'null', '[]', '{"letterKeys":"no","scheme":"green"}'])('takes the defaults for %j', (text) => {
    expect(keptPreferences(text)).toEqual({ letterKeys: true, scheme: 'dark' });
  });
});
