// Builds ../src/report/page.html: three.js and the sources of this folder in one file.
// `node build.mjs` writes it; `node build.mjs --check` fails when the committed file differs from what is built now.

import { readFileSync, readdirSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const target = join(here, '..', 'src', 'report', 'page.html');
const read = (...parts) => readFileSync(join(here, ...parts), 'utf8');

/** 64-bit FNV-1a of names and contents; the Rust test computes the same from the same files. */
function fingerprint(files) {
  let hash = 0xcbf29ce484222325n;
  const eat = (text) => {
    for (const byte of Buffer.from(text, 'utf8')) hash = ((hash ^ BigInt(byte)) * 0x100000001b3n) & 0xffffffffffffffffn;
  };
  for (const [name, content] of files) {
    eat(name);
    eat('\0');
    eat(content);
    eat('\0');
  }
  return hash.toString(16).padStart(16, '0');
}

const sources = ['build.mjs', 'package.json', 'package-lock.json', ...readdirSync(join(here, 'src')).map((name) => `src/${name}`)].sort();
const version = JSON.parse(read('package.json')).devDependencies;
const installed = JSON.parse(read('node_modules', 'three', 'package.json')).version;
if (installed !== version.three) throw new Error(`three ${installed} is installed, package.json asks for ${version.three}: run npm ci`);

const bundle = await build({
  entryPoints: [join(here, 'src', 'main.js')],
  bundle: true, minify: true, format: 'iife', target: ['es2022'], charset: 'utf8', legalComments: 'none', write: false,
});
const style = await build({ entryPoints: [join(here, 'src', 'style.css')], minify: true, target: ['es2022'], charset: 'utf8', write: false });
const licence = `/*! three.js ${installed}\n${read('node_modules', 'three', 'LICENSE').trim()}\n*/\n`;
const script = licence + bundle.outputFiles[0].text.trim();
const css = style.outputFiles[0].text.trim();
if (/<\/script|<!--/i.test(script)) throw new Error('the bundle would end its own script element');
if (/<\/style/i.test(css)) throw new Error('the style sheet would end its own element');
if (/@@gripfast-/.test(script + css)) throw new Error('the bundle holds a data mark');

const parts = { sources: fingerprint(sources.map((name) => [name, read(name)])), style: css, script };
const page = read('src', 'page.html').replace(/@@(sources|style|script)@@/g, (_, name) => parts[name]);

if (process.argv.includes('--check')) {
  if (readFileSync(target, 'utf8') !== page) {
    console.error('src/report/page.html is not what these sources build: run npm run build in viewer/');
    process.exit(1);
  }
  console.log('src/report/page.html is current');
} else {
  writeFileSync(target, page);
  console.log(`src/report/page.html: ${(page.length / 1024).toFixed(0)} KiB`);
}
