import type { Plugin } from 'vite';

/** Has the page itself ask for what its first, small module imports: the program is on its way one round trip earlier. */
export function programPreload(): Plugin {
  return {
    name: 'program-preload',
    apply: 'build',
    transformIndexHtml(_html, { chunk }) {
      return (chunk?.dynamicImports ?? []).map((name) => ({
        tag: 'link',
        attrs: { rel: 'modulepreload', crossorigin: true, href: `./${name}` },
        injectTo: 'head' as const,
      }));
    },
  };
}
