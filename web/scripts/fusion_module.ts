import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import type { Plugin } from 'vite';

const NAME = 'virtual:fusion-module';
const BUILT = fileURLToPath(new URL('../../build/wasm/bin/fusion.wasm', import.meta.url));

/**
 * The address of the fusion library as a WebAssembly module, which deploy/build_module.sh makes; null where it could not be made.
 * It is an asset like others: named by its content, and served by us.
 */
export function fusionModule(): Plugin {
  let isBuild = false;
  return {
    name: 'fusion-module',
    configResolved: (config) => {
      isBuild = config.command === 'build';
    },
    resolveId: (id) => (id === NAME ? `\0${NAME}` : null),
    load(id) {
      if (id !== `\0${NAME}`) return null;
      if (!existsSync(BUILT)) return 'export default null;';
      if (!isBuild) return `export default ${JSON.stringify(`/@fs${BUILT}`)};`;
      const reference = this.emitFile({ type: 'asset', name: 'fusion.wasm', source: readFileSync(BUILT) });
      return `export default import.meta.ROLLUP_FILE_URL_${reference};`;
    },
  };
}
