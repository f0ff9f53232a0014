import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Plugin } from 'vite';

const at = (path: string) => fileURLToPath(new URL(`../../${path}`, import.meta.url));
const RULE = '='.repeat(100);

/** What the WebAssembly module of the fusion library is compiled with, as Debian's packages. */
const MODULE_PACKAGES = ['libc++-14-dev-wasm32', 'wasi-libc', 'libhwy-dev'];

/** Folders of npm packages of which something is in the client; of workers, too, which are made before the page's own code. */
const shipped = new Set<string>();

interface Description {
  name: string;
  version: string;
  license?: string;
  author?: string | { name: string };
}

function apacheTerms(): string {
  return readFileSync(at('web/node_modules/typescript/LICENSE.txt'), 'utf8');
}

function noticeOf(folder: string): string {
  const description = JSON.parse(readFileSync(join(folder, 'package.json'), 'utf8')) as Description;
  const file = readdirSync(folder).find((name) => /^licen[cs]e(\.|$)/i.test(name));
  const { author } = description;
  const by = typeof author === 'string' ? author : (author?.name ?? '');
  let terms: string;
  if (file !== undefined) terms = readFileSync(join(folder, file), 'utf8');
  else if (description.license === 'Apache-2.0') terms = `${by}\nApache License, Version 2.0:\n\n${apacheTerms()}`;
  else throw new Error(`licences: ${description.name} says no terms (${description.license ?? 'none'})`);
  return `${RULE}\nIn the client: ${description.name} ${description.version}\n\n${terms.trim()}\n`;
}

/** The tables' own first lines say where they are from. */
function noticeOfPalettes(): string {
  const folder = at('fusion/colour/data');
  const lines = readdirSync(folder).map((name) => readFileSync(join(folder, name), 'utf8').split('\n', 1)[0]!);
  const matplotlib = readFileSync(at('deploy/licences/matplotlib.txt'), 'utf8');
  const list = lines.map((line) => `  ${line.replace(/^\/\/ /, '')}`).join('\n');
  return `${RULE}\nTables of palettes:\n\n${list}\n\nApache-2.0:\n\n${apacheTerms().trim()}\n\nmatplotlib:\n\n${matplotlib.trim()}\n`;
}

function noticesOfModule(): string[] {
  return MODULE_PACKAGES.map((name) => [name, `/usr/share/doc/${name}/copyright`] as const)
    .filter(([, file]) => existsSync(file))
    .map(([name, file]) => `${RULE}\nIn fusion.wasm: ${name}\n\n${readFileSync(file, 'utf8').trim()}\n`);
}

/** Notes what is shipped; for the page's code and for workers. */
export function shippedPackages(): Plugin {
  return {
    name: 'shipped-packages',
    apply: 'build',
    generateBundle(_options, bundle) {
      for (const part of Object.values(bundle)) {
        if (part.type !== 'chunk') continue;
        for (const id of part.moduleIds) {
          const folder = /^\0?(.*\/node_modules\/(?:@[^/]+\/)?[^/]+)\//.exec(id)?.[1];
          if (folder !== undefined) shipped.add(folder);
        }
      }
    },
  };
}

/** licences.txt: notices of everything by others that the client holds. */
export function licences(): Plugin {
  return {
    name: 'licences',
    apply: 'build',
    generateBundle: {
      order: 'post',
      handler(_options, bundle) {
        const hasModule = Object.keys(bundle).some((name) => /fusion.*\.wasm$/.test(name));
        const source = [
          'The web client of Spectra holds works of others. These are their notices, made from what this build holds.\n',
          ...[...shipped].sort().map(noticeOf),
          ...(hasModule ? noticesOfModule() : []),
          noticeOfPalettes(),
        ].join('\n');
        this.emitFile({ type: 'asset', fileName: 'licences.txt', source });
      },
    },
  };
}
