import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { minify } from 'terser';
import type { Plugin } from 'vite';

/** The service worker stands beside the page under a name of its own, so that nothing else makes it smaller. */
export function smallKeeper(): Plugin {
  return {
    name: 'small-keeper',
    apply: 'build',
    async writeBundle({ dir }) {
      const path = join(dir!, 'kept.js');
      const { code } = await minify(readFileSync(path, 'utf8'), { module: true });
      writeFileSync(path, code!);
    },
  };
}
