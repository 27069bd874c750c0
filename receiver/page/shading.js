/**
 * The avatar's light and shadow in WebGL: the same as `receiver.drawing.portrait`, from whose table
 * its numbers are taken. The casting part is drawn as the key light sees it, blurred, and taken from the
 * key light where it lies behind that part.
 */

/** Depth in mm of the shadow's map: the cuer is nearer to the camera's centre than half of it. */
const DEPTH_MM = 1024;

const MOVE = `
attribute vec3 position, normal;
attribute vec4 colour;
attribute vec3 extra;
uniform vec3 turn, shift, base, pivot, centre, lean, head;
uniform vec3 frame;
uniform mat3 toLight;
uniform float extent;
vec3 rotated(vec3 p, vec3 r) {
  float a2 = dot(r, r);
  float a = sqrt(a2);
  float s = a < 1e-4 ? 1.0 - a2 / 6.0 : sin(a) / a;
  float c = a < 1e-4 ? 0.5 - a2 / 24.0 : (1.0 - cos(a)) / a2;
  vec3 once = cross(r, p);
  return p + s * once + c * cross(r, once);
}
vec3 moved() {
  vec3 p = rotated(position - base, turn * extra.y) + shift * extra.z + pivot;
  p += cross(lean, p - head) - centre;
  return vec3(frame.z * p.x, p.yz);
}
vec3 seenFromLight(vec3 p) {
  vec3 q = p * toLight;
  return vec3(q.xy * 2.0 / extent, q.z / ${DEPTH_MM}.0 + 0.5);
}`;

const SKIN_VERTEX = `${MOVE}
varying vec3 n, inLight;
varying vec4 tint;
varying float opacity;
void main() {
  vec3 p = moved();
  // Area normals of unequal length could turn round where a thin triangle is read beside its edge.
  n = rotated(normal / max(length(normal), 1e-9), turn * extra.y);
  n += cross(lean, n);
  n.x *= frame.z;
  tint = vec4(pow(colour.rgb, vec3(2.2)), colour.a);
  opacity = extra.x;
  inLight = seenFromLight(p);
  float w = 1.0 - p.z / frame.y;
  gl_Position = vec4(vec3(p.x * frame.x, p.y * 2.0, -p.z * w) / HEIGHT, w);
}`;

const CAST_VERTEX = `${MOVE}
varying float opacity, depth;
void main() {
  vec3 seen = seenFromLight(moved());
  opacity = extra.x;
  depth = seen.z;
  gl_Position = vec4(seen.xy, 1.0 - 2.0 * seen.z, 1.0);
}`;

/** Two numbers of 0 to 1 in four bytes. */
const PACK = `
precision highp float;
vec2 split(float v) {
  float whole = floor(v * 255.0);
  return vec2(whole / 255.0, v * 255.0 - whole);
}
vec4 pack(float cover, float depth) { return vec4(split(min(depth, 0.9999)), split(min(cover, 0.9999))); }
vec2 unpack(vec4 p) { return vec2(p.b + p.a / 255.0, p.r + p.g / 255.0); }`;

const CAST_FRAGMENT = `${PACK}
varying float opacity, depth;
void main() { gl_FragColor = pack(opacity, opacity * depth); }`;

const BLUR_VERTEX = `
attribute vec3 position;
varying vec2 at;
void main() {
  at = position.xy * 0.5 + 0.5;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const BLUR_FRAGMENT = `${PACK}
varying vec2 at;
uniform sampler2D map;
uniform vec2 along;
uniform float weights[TAPS];
void main() {
  vec2 sum = vec2(0.0);
  for (int k = 0; k < TAPS; k++) sum += weights[k] * unpack(texture2D(map, at + along * (float(k) - (TAPS.0 - 1.0) / 2.0)));
  gl_FragColor = pack(sum.x, sum.y);
}`;

const SKIN_FRAGMENT = `${PACK}
varying vec3 n, inLight;
varying vec4 tint;
varying float opacity;
uniform float alpha, receives;
uniform vec3 light[9];
uniform sampler2D map;
float free() {
  vec2 at = inLight.xy * (SIDE / 2.0) + (SIDE - 1.0) / 2.0;
  if (receives < 0.5 || at.x < 0.0 || at.y < 0.0 || at.x >= SIDE - 1.0 || at.y >= SIDE - 1.0) return 1.0;
  vec2 low = (floor(at) + 0.5) / SIDE;
  vec2 f = fract(at);
  float s = 1.0 / SIDE;
  vec2 upper = mix(unpack(texture2D(map, low)), unpack(texture2D(map, low + vec2(s, 0.0))), f.x);
  vec2 lower = mix(unpack(texture2D(map, low + vec2(0.0, s))), unpack(texture2D(map, low + vec2(s, s))), f.x);
  vec2 caster = mix(upper, lower, f.y);
  if (caster.x < 0.004) return 1.0;
  float gap = (caster.y / caster.x - inLight.z) * ${DEPTH_MM}.0;
  float contact = clamp(gap / light[8].y, 0.0, 1.0);
  return 1.0 - light[8].x * caster.x * contact / (1.0 + max(0.0, gap) / light[8].z);
}
void main() {
  float a = opacity * alpha;
  if (a < 0.004) discard;
  // At a triangle's edge what varies is read beside it: keep it within its limits.
  vec4 inTint = clamp(tint, 0.0, 1.0);
  vec3 m = normalize(n);
  float open = free();
  vec3 key = clamp((dot(m, light[0]) + light[2]) / (1.0 + light[2]), 0.0, 1.0);
  key *= sqrt(sqrt(key)) * open * light[3];
  float rim = clamp(1.0 - m.z, 0.0, 1.0);
  key += (light[4] + light[5] * (0.5 + 0.5 * m.y)) * (0.5 + 0.5 * open) + light[6] * rim * rim * rim;
  float half_ = max(dot(m, light[1]), 0.0);
  half_ *= half_;
  half_ *= half_;
  half_ *= half_;
  half_ *= half_;
  vec3 c = inTint.rgb * key + light[7] * inTint.a * half_ * half_ * open;
  gl_FragColor = vec4(pow(min(c, 1.0), vec3(1.0 / 2.2)) * a, a);
}`;

/**
 * A shader in WebGL 2's language, where what varies is read inside the triangle (`centroid`): at the
 * edge of a thin one, a value read at the pixel's middle lies outside it, and shows as a dark speck.
 * @param {string} source @param {boolean} isVertex
 */
function modern(source, isVertex) {
  const changed = source.replace(/varying /g, isVertex ? "centroid out " : "centroid in ")
    .replace(/attribute /g, "in ").replace(/texture2D/g, "texture").replace(/gl_FragColor/g, "shown");
  return `#version 300 es\n${isVertex ? "" : "precision highp float;\nout vec4 shown;\n"}${changed}`;
}

/** Compile a program; `handle`, and its attributes and uniforms by name. @param {GL} gl @param {string} vertex @param {string} fragment */
function link(gl, vertex, fragment) {
  const handle = gl.createProgram();
  for (const isVertex of [true, false]) {
    const source = isVertex ? vertex : fragment;
    const shader = /** @type {WebGLShader} */ (gl.createShader(isVertex ? gl.VERTEX_SHADER : gl.FRAGMENT_SHADER));
    const hasCentroid = typeof WebGL2RenderingContext !== "undefined" && gl instanceof WebGL2RenderingContext;
    gl.shaderSource(shader, hasCentroid ? modern(source, isVertex) : source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) || "shader");
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(handle) || "program");
  /** @param {number} count @param {"getActiveAttrib"|"getActiveUniform"} active @param {"getAttribLocation"|"getUniformLocation"} find */
  const collect = (count, active, find) => Object.fromEntries(
    Array.from({ length: gl.getProgramParameter(handle, count) }, (_, i) => {
      const name = /** @type {WebGLActiveInfo} */ (gl[active](handle, i)).name.replace("[0]", "");
      return [name, gl[find](handle, name)];
    }),
  );
  return {
    handle,
    attributes: /** @type {Record<string, number>} */ (collect(gl.ACTIVE_ATTRIBUTES, "getActiveAttrib", "getAttribLocation")),
    uniforms: /** @type {Record<string, WebGLUniformLocation | null>} */ (collect(gl.ACTIVE_UNIFORMS, "getActiveUniform", "getUniformLocation")),
  };
}

/** The programs of an avatar, and the shadow's map. */
export class Shading {
  /** `arrays` of the avatar's document; `heightMm` of the camera's picture. @param {GL} gl @param {Arrays} arrays @param {number} heightMm */
  constructor(gl, arrays, heightMm) {
    this.gl = gl;
    const [side, texelMm, ...weights] = arrays.shadow;
    this.side = side;
    /** @param {string} text */
    const fill = (text) => text.replaceAll("TAPS", String(weights.length)).replaceAll("SIDE", `${side}.0`).replace("HEIGHT", heightMm.toFixed(3));
    this.skin = link(gl, fill(SKIN_VERTEX), fill(SKIN_FRAGMENT));
    this.cast = link(gl, CAST_VERTEX, CAST_FRAGMENT);
    this.blur = link(gl, BLUR_VERTEX, fill(BLUR_FRAGMENT));
    gl.useProgram(this.skin.handle);
    gl.uniform3fv(this.skin.uniforms.light, arrays.light);
    for (const program of [this.skin, this.cast]) {
      gl.useProgram(program.handle);
      gl.uniformMatrix3fv(program.uniforms.toLight, false, arrays.from_light);
      gl.uniform1f(program.uniforms.extent, side * texelMm);
    }
    gl.useProgram(this.blur.handle);
    gl.uniform1fv(this.blur.uniforms.weights, weights);
    this.quad = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.quad);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]), gl.STATIC_DRAW);
    this.maps = [this.target(true), this.target(false)];
  }

  /** A texture to be drawn into. @param {boolean} withDepth */
  target(withDepth) {
    const { gl, side } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, side, side, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    const buffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    if (withDepth) {
      const depth = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT16, side, side);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    }
    return { texture, buffer };
  }

  /** Make the shadow's map; `draw(program)` draws what casts it. @param {(program: Program) => void} draw */
  castShadow(draw) {
    const { gl, side, maps, blur } = this;
    gl.viewport(0, 0, side, side);
    gl.disable(gl.BLEND);
    gl.clearColor(0, 0, 0, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, maps[0].buffer);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.cast.handle);
    draw(this.cast);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.useProgram(blur.handle);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.quad);
    gl.enableVertexAttribArray(blur.attributes.position);
    gl.vertexAttribPointer(blur.attributes.position, 3, gl.FLOAT, false, 0, 0);
    for (const from of [0, 1]) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, maps[1 - from].buffer);
      gl.bindTexture(gl.TEXTURE_2D, maps[from].texture);
      gl.uniform2f(blur.uniforms.along, (1 - from) / side, from / side);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.bindTexture(gl.TEXTURE_2D, maps[0].texture);
    gl.enable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
  }
}
