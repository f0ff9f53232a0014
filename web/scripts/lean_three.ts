import type { Plugin } from 'vite';

/** What WebGLRenderer asks of the parts that are never used here: as they answer when they are switched off. */
const HOLLOW: Record<string, string> = {
  'extras/PMREMGenerator.js': 'export class PMREMGenerator {}',
  'renderers/webgl/WebGLCubeMaps.js': 'export function WebGLCubeMaps() { return { get: (texture) => texture, dispose() {} }; }',
  'renderers/webgl/WebGLCubeUVMaps.js':
    'export function WebGLCubeUVMaps() { return { get: (texture) => texture, dispose() {} }; }',
  'renderers/webgl/WebGLMorphtargets.js': 'export function WebGLMorphtargets() { return { update() {} }; }',
  'renderers/webgl/WebGLUniformsGroups.js':
    'export function WebGLUniformsGroups() { return { bind() {}, update() {}, dispose() {} }; }',
  'renderers/webgl/WebGLShadowMap.js': 'export class WebGLShadowMap { enabled = false; render() {} }',
  'renderers/webxr/WebXRManager.js': `export class WebXRManager {
    enabled = false; isPresenting = false; cameraAutoUpdate = false;
    addEventListener() {} removeEventListener() {} setAnimationLoop() {} dispose() {} getEnvironmentBlendMode() {}
  }`,
};

/**
 * three.js without its own materials' shaders, its shadows and its glasses: what is drawn here brings its shaders along, and the rest
 * would be a third of what draws, on its way before the first picture.
 */
export function leanThree(): Plugin {
  return {
    name: 'lean-three',
    enforce: 'pre',
    apply: 'build',
    // Its files one by one: the package's one big module cannot be taken apart.
    resolveId(source, importer, options) {
      return source === 'three' ? this.resolve('three/src/Three.js', importer, { ...options, skipSelf: true }) : null;
    },
    load(id) {
      const [, file] = /\/three\/src\/(.*)$/.exec(id) ?? [];
      if (file === undefined) return null;
      if (/^renderers\/shaders\/ShaderChunk\/.*\.glsl\.js$/.test(file)) return "export default '';";
      if (/^renderers\/shaders\/ShaderLib\/.*\.glsl\.js$/.test(file))
        return "export const vertex = ''; export const fragment = '';";
      return HOLLOW[file] ?? null;
    },
    // What it says to who programs with it: 6 kB in every worker that draws.
    transform(code, id) {
      return /\/three\/src\//.test(id) ? { code: code.replace(/'THREE\.(?:[^'\\\n]|\\.)*'/g, "'three.js'"), map: null } : null;
    },
  };
}
