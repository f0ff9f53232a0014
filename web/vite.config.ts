import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vitest/config';
import { fusionModule } from './scripts/fusion_module';
import { licences, shippedPackages } from './scripts/licences';
import { leanThree } from './scripts/lean_three';
import { precompressed } from './scripts/precompressed';
import { programPreload } from './scripts/program_preload';
import { smallKeeper } from './scripts/small_keeper';

const server = process.env.SPECTRA_URL ?? 'http://127.0.0.1:8600';

export default defineConfig({
  plugins: [
    leanThree(),
    fusionModule(),
    svelte(),
    programPreload(),
    precompressed(),
    smallKeeper(),
    shippedPackages(),
    licences(),
  ],
  base: './',
  // One style sheet and plain imports: the page itself says what is to be loaded early.
  build: {
    target: 'es2022',
    chunkSizeWarningLimit: 900,
    assetsInlineLimit: 0,
    cssCodeSplit: false,
    modulePreload: false,
    minify: 'terser',
    terserOptions: { ecma: 2020, compress: { passes: 3 } },
  },
  worker: { format: 'es', plugins: () => [leanThree(), shippedPackages()] },
  // By number: a machine without /etc/hosts does not know "localhost".
  server: {
    host: '127.0.0.1',
    proxy: { '/ws': { target: server, ws: true, changeOrigin: true }, '/api': server },
  },
  test: { include: ['src/**/*.test.ts'], environment: 'node' },
});
