import type { Plugin } from 'vite';

/**
 * What is asked of parts that are never used here: as they answer when they are switched off, or have raw shader materials alone to draw
 * and one colour behind them.
 */
const HOLLOW: Record<string, string> = {
  'core/Raycaster.js': 'export class Raycaster {}',
  'extras/PMREMGenerator.js': 'export class PMREMGenerator {}',
  'renderers/shaders/ShaderChunk.js': 'export const ShaderChunk = {};',
  'renderers/shaders/ShaderLib.js': 'export const ShaderLib = {};',
  'renderers/webgl/WebGLBackground.js': `
    import { Color } from '../../math/Color.js';
    import { getUnlitUniformColorSpace } from '../shaders/UniformsUtils.js';
    export function WebGLBackground(renderer, cubemaps, cubeuvmaps, state, objects, alpha, premultipliedAlpha) {
      const colour = new Color(0);
      const rgb = {};
      let clearAlpha = alpha ? 0 : 1;
      const set = () => {
        colour.getRGB(rgb, getUnlitUniformColorSpace(renderer));
        state.buffers.color.setClear(rgb.r, rgb.g, rgb.b, clearAlpha, premultipliedAlpha);
      };
      return {
        getClearColor: () => colour,
        setClearColor(next, alpha = 1) { colour.set(next); clearAlpha = alpha; set(); },
        getClearAlpha: () => clearAlpha,
        render() { set(); if (renderer.autoClear) renderer.clear(); },
        addToRenderList() {},
      };
    }`,
  'renderers/webgl/WebGLCubeMaps.js': 'export function WebGLCubeMaps() { return { get: (texture) => texture, dispose() {} }; }',
  'renderers/webgl/WebGLCubeUVMaps.js':
    'export function WebGLCubeUVMaps() { return { get: (texture) => texture, dispose() {} }; }',
  'renderers/webgl/WebGLLights.js': `export function WebGLLights() {
    const none = [];
    const state = { version: 0, directional: none, point: none, spot: none, spotLightMap: none, rectArea: none, hemi: none,
      directionalShadowMap: none, pointShadowMap: none, spotShadowMap: none, numSpotLightShadowsWithMaps: 0, numLightProbes: 0 };
    return { state, setup() {}, setupView() {} };
  }`,
  'renderers/webgl/WebGLMaterials.js': `export function WebGLMaterials() {
    return { refreshMaterialUniforms(uniforms, material) { material.uniformsNeedUpdate = false; } };
  }`,
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
      return HOLLOW[file] ?? null;
    },
    // Without what it says to who programs with it, and without how its objects are written to files and met by rays.
    transform(code, id) {
      if (!/\/three\/src\//.test(id)) return null;
      const lean = code
        .replace(/'THREE\.(?:[^'\\\n]|\\.)*'/g, "'three.js'")
        .replace(/^\t(?:toJSON|raycast)\(.*\) \{\n[^]*?^\t\}\n/gm, '');
      return { code: lean, map: null };
    },
  };
}
