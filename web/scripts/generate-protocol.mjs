// Writes src/protocol/generated.ts from protocol/schema: one type per definition, by its own name.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { compile } from 'json-schema-to-typescript';

const schemas = new URL('../../protocol/schema/', import.meta.url);
const output = new URL('../src/protocol/generated.ts', import.meta.url);

const definitions = {};
for (const file of readdirSync(schemas)
  .filter((name) => name.endsWith('.schema.json'))
  .sort()) {
  const schema = JSON.parse(readFileSync(new URL(file, schemas), 'utf8'));
  for (const [name, definition] of Object.entries(schema.$defs ?? {})) {
    if (name in definitions) throw new Error(`${file}: ${name} is defined twice`);
    definitions[name] = definition;
  }
}

/** All definitions stand in one document here, so every reference becomes a local one. */
function localised(value) {
  if (Array.isArray(value)) return value.map(localised);
  if (typeof value !== 'object' || value === null) return value;
  // A list of 256 colours is a list: only short ones become tuples.
  const entries = Object.entries(value).filter(([key, inner]) => !(/^(min|max)Items$/.test(key) && inner > 4));
  return Object.fromEntries(
    entries.map(([key, inner]) => [key, key === '$ref' ? inner.replace(/^.*#\/\$defs\//, '#/$defs/') : localised(inner)]),
  );
}

const names = Object.keys(definitions).sort();
const document = {
  title: 'ProtocolDefinitions',
  type: 'object',
  additionalProperties: false,
  properties: Object.fromEntries(names.map((name) => [name, { $ref: `#/$defs/${name}` }])),
  required: names,
  $defs: localised(definitions),
};
const source = await compile(document, 'ProtocolDefinitions', {
  additionalProperties: false,
  bannerComment: '// Made by `npm run generate` from protocol/schema. Not to be edited.',
  unreachableDefinitions: false,
});
const text = `${source.trimEnd()}\n`;
if (process.argv.includes('--check')) {
  if (readFileSync(output, 'utf8') !== text) {
    console.error('src/protocol/generated.ts is not what protocol/schema says: run `npm run generate`');
    process.exit(1);
  }
} else {
  writeFileSync(output, text);
}
