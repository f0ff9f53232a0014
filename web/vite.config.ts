import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vitest/config';
import { precompressed } from './scripts/precompressed';

const server = process.env.SPECTRA_URL ?? 'http://127.0.0.1:8600';

export default defineConfig({
  plugins: [svelte(), precompressed()],
  base: './',
  build: { target: 'es2022', chunkSizeWarningLimit: 900, assetsInlineLimit: 0 },
  worker: { format: 'es' },
  // By number: a machine without /etc/hosts does not know "localhost".
  server: {
    host: '127.0.0.1',
    proxy: { '/ws': { target: server, ws: true, changeOrigin: true }, '/api': server },
  },
  test: { include: ['src/**/*.test.ts'], environment: 'node' },
});
