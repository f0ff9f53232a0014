import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { brotliCompressSync, constants } from 'node:zlib';
import { gzipAsync } from '@gfx/zopfli';
import type { Plugin } from 'vite';

/**
 * Beside every asset that it makes smaller: the same in Brotli (.br) and in gzip (.gz), for the server to choose from. Over plain HTTP browsers
 * take no Brotli, so gzip is made by Zopfli: a twentieth smaller than zlib's, with as many blocks as it finds of use.
 */
export function precompressed(): Plugin {
  return {
    name: 'precompressed',
    apply: 'build',
    async writeBundle({ dir }) {
      const folder = join(dir!, 'assets');
      for (const name of readdirSync(folder)) {
        const path = join(folder, name);
        const plain = readFileSync(path);
        const versions = {
          br: brotliCompressSync(plain, { params: { [constants.BROTLI_PARAM_SIZE_HINT]: plain.length } }),
          gz: await gzipAsync(plain, { numiterations: 15, blocksplittingmax: 0 }),
        };
        for (const [ending, version] of Object.entries(versions)) {
          if (version.length < plain.length) writeFileSync(`${path}.${ending}`, version);
        }
      }
    },
  };
}
