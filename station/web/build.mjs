// Builds the page's script and styles: src/ -> dist/. `node build.mjs OUT` builds elsewhere (the test that dist/ is current).
import { build } from 'esbuild';
import { mkdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, 'dist');
mkdirSync(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { page: 'src/main.tsx' },
  bundle: true,
  minify: true,
  format: 'esm',
  target: ['es2020'],
  jsx: 'automatic',
  jsxImportSource: 'preact',
  legalComments: 'none',
  charset: 'ascii',
  banner: {
    js: '/* sixpoint page; with preact and uPlot, both MIT: station/web/LICENSES.md */',
  },
  outdir: out,
  logLevel: 'warning',
});
