import type { Plugin } from 'vite';

/**
 * Has the page itself ask for what its first, small module imports: the program is on its way one round trip earlier. That module does
 * not wait for the style sheet, nor for anything else.
 */
export function programPreload(): Plugin {
  return {
    name: 'program-preload',
    apply: 'build',
    transformIndexHtml: {
      order: 'post',
      handler(html, { chunk }) {
        const tags = (chunk?.dynamicImports ?? []).map((name) => ({
          tag: 'link',
          attrs: { rel: 'modulepreload', crossorigin: true, href: `./${name}` },
          injectTo: 'head' as const,
        }));
        return { html: html.replace('<script type="module"', '<script type="module" async'), tags };
      },
    },
  };
}
