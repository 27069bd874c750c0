const $movement = (() => {
/**
 * What the cuer's face and trunk do beside the parameters on air: lids, gaze, brows, head, breath.
 *
 * The same as `receiver.drawing.movement`, by the same table, which travels in the voice's document.
 */

class Movement {
  /** @param model a `VoiceModel` @param {Model} model */
  constructor(model) {
    this.rules = model.rules;
    const { taps, step_s: step, hand_s: hand, mouth_s: mouth } = this.rules;
    this.kernels = [...hand, ...mouth].map((tau) => {
      const weights = Array.from({ length: taps }, (_, i) => Math.exp(-i * step / tau));
      const total = weights.reduce((sum, weight) => sum + weight, 0);
      return weights.map((weight) => weight / total);
    });
    this.params = new Float64Array(model.layout.length);
    this.raised = new Float64Array(taps);
    this.mouth = new Float64Array(taps);
  }

  /**
   * What the rules add at `timeS`; `sample(timeS, out)` writes parameters, or returns 0 where none are known.
   * @param {number} timeS @param {Sample} sample
   */
  at(timeS, sample) {
    const { rules } = this;
    this.remember(timeS, sample);
    const [cueing, lately, near, mean] = this.kernels.map((weights, i) => dot(weights, i < 2 ? this.raised : this.mouth));
    const onset = Math.max(cueing - lately, 0);
    const end = Math.max(lately - cueing, 0);
    const accent = near - mean;
    const [size, period, phase] = rules.breath_wave;
    const wave = size * (1 - lately) * Math.sin(2 * Math.PI * (timeS / period + phase));
    const breath = clip(rules.breath[0] + rules.breath[1] * onset + wave);
    const shapes = this.face(timeS, accent, onset, lately);
    shapes.breath = breath;
    return {
      shapes,
      gaze: this.fixation(timeS, lately).map((x, i) => x + rules.lens_rad[i]),
      nod: this.nod(timeS, accent, onset, end, lately),
      trunk: [0, 1, 2].map((k) => waves(timeS, rules.trunk_waves[k]) + rules.trunk_raised_mm[k] * lately + rules.trunk_breath_mm[k] * breath),
      breath,
    };
  }

  /** Sample the two signals from `timeS` back; before the first known parameters those are held. @param {number} timeS @param {Sample} sample */
  remember(timeS, sample) {
    const { taps, step_s: step, signals } = this.rules;
    this.params.fill(0);
    for (let i = 0; i < taps; i++) {
      sample(timeS - i * step, this.params);
      const [raised, mouth] = signals.map((factors) => this.params.reduce((sum, x, k) => sum + x * factors[k + 1], factors[0]));
      this.raised[i] = smooth(raised);
      this.mouth[i] = mouth;
    }
  }

  /** @param {number} t @param {number} accent @param {number} onset @param {number} end @param {number} lately */
  nod(t, accent, onset, end, lately) {
    const { nod: rule, resting_share: rest, head_waves: head } = this.rules;
    const share = rest + (1 - rest) * lately;
    const turn = head.map((list) => share * waves(t, list));
    turn[0] += rule.per_mm * accent + rule.onset * onset + rule.end * end;
    return turn.map((x) => rule.most_rad * Math.tanh(x / rule.most_rad));
  }

  /** The eyes' offset from the lens: still, then a jump, then still. @param {number} t @param {number} lately */
  fixation(t, lately) {
    const { fixation_s: slot, saccade_s: jump, wander_rad: [cueing, resting] } = this.rules;
    const at = t / slot;
    const number = Math.floor(at);
    const late = slot * (at - number) - 0.5 * slot * chance(3 * number);
    const jumped = smooth(late / jump);
    return [1, 2].map((k, i) => {
      /** @param {number} n */
      const place = (n) => (2 * chance(3 * n + k) - 1) ** 3;
      const still = (1 - jumped) * place(number - 1) + jumped * place(number);
      return still * (resting[i] + lately * (cueing[i] - resting[i]));
    });
  }

  /** How far lids are closed `u` seconds after a blink began. @param {number} u */
  lids(u) {
    const [closing, closed, opening] = this.rules.blink_s;
    return Math.min(smooth(u / closing), smooth((closing + closed + opening - u) / opening));
  }

  /** How far the lids are closed, 0 to 1: by chance, and where the hand sinks. @param {number} t */
  blink(t) {
    const { blink_slot_s: slot, blink_after_s: after, step_s: step } = this.rules;
    const number = Math.floor(t / slot);
    let shut = 0;
    for (const n of [number - 1, number]) {
      const drawn = chance(7 * n);
      if ([-2, -1, 1, 2].some((k) => chance(7 * (n + k)) >= drawn)) continue;
      shut = Math.max(shut, this.lids(t - slot * (n + 0.8 * chance(7 * n + 1))));
    }
    const { raised } = this;
    for (let i = 0; i + 1 < raised.length; i++) {
      if (!(raised[i] < 0.5 && raised[i + 1] >= 0.5)) continue;
      const ago = step * (i + (0.5 - raised[i]) / (raised[i + 1] - raised[i]));
      return Math.max(shut, this.lids(ago - after));
    }
    return shut;
  }

  /** Weights of brows, lids and cheeks. @param {number} t @param {number} accent @param {number} onset @param {number} lately */
  face(t, accent, onset, lately) {
    const { rules } = this;
    const [size, period, phase] = rules.knit_wave;
    const knit = Math.max(size * Math.sin(2 * Math.PI * (t / period + phase)), 0) * lately;
    const lift = clip(rules.brow_onset * onset + rules.brow_per_mm * Math.max(accent, 0) - 0.3 * knit);
    const shut = this.blink(t);
    const squint = clip(rules.squint[0] + rules.squint[1] * knit) * (1 - shut);
    const cheek = clip(rules.cheek_per_mm * Math.max(-accent, 0) + 0.3 * knit);
    const wide = clip(rules.wide_onset * onset) * (1 - shut);
    /** @type {Record<string, number>} */
    const shapes = { browInnerUp: 0.6 * lift };
    for (const side of ["Left", "Right"]) {
      const own = { eyeBlink: rules.lids_rest + (1 - rules.lids_rest) * shut, browOuterUp: lift, browDown: knit, eyeSquint: squint, cheekSquint: cheek, eyeWide: wide };
      for (const [name, weight] of Object.entries(own)) shapes[name + side] = weight;
    }
    return shapes;
  }
}

/** An evenly spread number, 0 to 1, that a whole number always gives. @param {number} number */
function chance(number) {
  let x = number >>> 0;
  x = Math.imul(x ^ (x >>> 16), 0x21f0aaad) >>> 0;
  x = Math.imul(x ^ (x >>> 15), 0x735a2d97) >>> 0;
  return ((x ^ (x >>> 15)) >>> 0) / 4294967296;
}

/** @param {number} x */
const clip = (x) => Math.max(0, Math.min(1, x));
/** @param {number[]} weights @param {Float64Array} values */
const dot = (weights, values) => weights.reduce((sum, weight, i) => sum + weight * values[i], 0);
/** @param {number} t @param {Wave[]} list */
const waves = (t, list) => list.reduce((sum, [size, period, phase]) => sum + size * Math.sin(2 * Math.PI * (t / period + phase)), 0);

/** @param {number} x */
function smooth(x) {
  const part = clip(x);
  return part * part * (3 - 2 * part);
}
return { Movement, chance };
})();

const $mouth = (() => {
/**
 * The lips over the teeth: neither cut each other nor the teeth. The rule and the constants of
 * `receiver.drawing.mouth`, on the coarse mesh of the head before its motion.
 */

const EDGE = 6;
const FOLLOW = [1, 1, 1, 1, 1, 1, 1, 0.85, 0.65, 0.45, 0.25, 0.1, 0];
const LOWER_SHARE = 0.65;
const BULGE_MM = 1.2;
const CLEARANCE_MM = 1.4;
const RAMP_MM = 2;

class Mouth {
  /** @param {Arrays} arrays */
  constructor(arrays) {
    this.rings = arrays.mouth_rings;
    this.upper = arrays.mouth_upper;
    this.lower = arrays.mouth_lower;
    this.beside = arrays.mouth_beside;
    this.between = arrays.mouth_between;
    this.lining = arrays.mouth_lining;
    this.arch = arrays.mouth_arch;
    this.columns = this.rings.length / FOLLOW.length;
    this.jaw = arrays.mouth_jaw[0];
    this.jawRest = arrays.mouth_jaw_rest;
    this.pressed = new Float64Array(this.columns);
    this.heights = new Float64Array(this.columns);
    this.overlap = new Float64Array(this.upper.length);
  }

  /** Correct the coarse mesh (x, y, z of each vertex), in place. @param {Float32Array} control */
  solve(control) {
    const { rings, columns, pressed } = this;
    this.level(control);
    this.part();
    for (let r = 0; r < FOLLOW.length; r++) {
      for (let c = 0; c < columns; c++) {
        const at = 3 * rings[r * columns + c];
        control[at + 1] += FOLLOW[r] * pressed[c];
        if (r >= EDGE) this.clear(control, at);
      }
    }
    for (let i = 0; i < EDGE * columns; i++) {
      const edge = 3 * rings[EDGE * columns + (i % columns)];
      for (let k = 0; k < 3; k++) control[3 * rings[i] + k] = control[edge + k] + this.lining[3 * i + k];
    }
  }

  /** Take the heights of the edge; those of the lower lip level where it bulges. @param {Float32Array} control */
  level(control) {
    const { rings, columns, lower, heights, pressed } = this;
    /** @param {number} column @param {number} axis */
    const place = (column, axis) => control[3 * rings[EDGE * columns + column] + axis];
    for (let c = 0; c < columns; c++) heights[c] = place(c, 1);
    const [first, last] = [lower[0], lower[lower.length - 1]];
    const slope = (heights[last] - heights[first]) / (place(last, 0) - place(first, 0));
    /** @param {number} column */
    const above = (column) => place(column, 1) - heights[first] - slope * (place(column, 0) - place(first, 0));
    let most = 0;
    for (const column of lower) most = Math.max(most, above(column));
    const share = Math.min(1, most / BULGE_MM);
    for (let c = 0; c < columns; c++) pressed[c] = -heights[c];
    for (const column of lower) if (column !== first && column !== last) heights[column] -= share * above(column);
  }

  /** Move the heights of the edge so that the lips meet and do not overlap. */
  part() {
    const { columns, upper, lower, beside, between, pressed, heights, overlap } = this;
    /** @param {number} i */
    const below = (i) => heights[lower[beside[i]]] + between[i] * (heights[lower[beside[i] + 1]] - heights[lower[beside[i]]]);
    for (let i = 0; i < upper.length; i++) overlap[i] = Math.max(below(i) - heights[upper[i]], 0);
    for (let k = 0; k < lower.length; k++) {
      let most = 0;
      for (let i = 0; i < upper.length; i++) if (beside[i] === k || beside[i] === k - 1) most = Math.max(most, overlap[i]);
      heights[lower[k]] -= LOWER_SHARE * most;
    }
    for (let i = 1; i < upper.length - 1; i++) heights[upper[i]] = Math.max(heights[upper[i]], below(i));
    for (let c = 0; c < columns; c++) pressed[c] += heights[c];
  }

  /** Hold a vertex of the lips in front of both rows of teeth. @param {Float32Array} control @param {number} at */
  clear(control, at) {
    const { arch, jaw, jawRest } = this;
    for (let row = 0; row < 2; row++) {
      const side = row === 0 ? 1 : -1;
      const [front, bend, steep, tip, middle] = arch.subarray(5 * row, 5 * row + 5);
      const y = row === 0 ? 0 : control[3 * jaw + 1] - jawRest[1];
      const z = row === 0 ? 0 : control[3 * jaw + 2] - jawRest[2];
      const across = (control[at] - middle) ** 2;
      const wall = front + z - across * (bend + steep * across) + CLEARANCE_MM;
      const held = Math.min(1, Math.max(0, 1 + (side * (control[at + 1] - tip - y)) / RAMP_MM));
      control[at + 2] += held * Math.max(0, wall - control[at + 2]);
    }
  }
}
return { Mouth };
})();

const $points = (() => {
/**
 * Point lights: one disc per marker on a transparent canvas, far discs smaller and first.
 *
 * The camera is `{centre: [x, y, z], height_mm, distance_mm}`: `centre` falls into the middle of
 * the picture, `height_mm` fills its height, and depth shrinks by distance / (distance - depth).
 */

class PointLights {
  /** @param {HTMLCanvasElement} canvas @param {Model} model */
  constructor(canvas, model) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.model = model;
    this.order = Array.from(model.markers, (_, i) => i);
    this.xy = new Float64Array(2 * model.markers.length);
    this.scale = new Float64Array(model.markers.length);
  }

  /** Draw `markers` (3 numbers each); `look`: {alpha, mirror, handOnly, contrast, dot}. @param {Numbers} markers @param {Look} look */
  draw(markers, look) {
    const { canvas, context } = this;
    fit(canvas);
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (look.alpha <= 0) return;
    this.project(markers, look.mirror);
    const order = this.order.sort((a, b) => markers[3 * a + 2] - markers[3 * b + 2]);
    context.globalAlpha = look.alpha;
    const radius = look.dot * canvas.height / 100;
    if (look.contrast === "outline") {
      context.fillStyle = "rgba(0,0,0,.85)";
      this.discs(order, look, radius * 1.55);
    }
    for (const [colour, wanted] of this.groups(look)) {
      context.fillStyle = colour;
      this.discs(order, { handOnly: look.handOnly, wanted }, radius);
    }
  }

  /**
   * Colours with the markers that have them; the hand is drawn over the face.
   * @param {Look} look
   * @returns {[string, (i: number) => boolean][]}
   */
  groups(look) {
    const n = this.model.faceCount;
    const face = look.contrast === "strong" ? "#ffffff" : "#eef0f6";
    const hand = look.contrast === "strong" ? "#ffe14a" : "#ffd9a0";
    return [[face, (i) => i < n], [hand, (i) => i >= n]];
  }

  /** @param {number[]} order @param {{handOnly: boolean, wanted?: (i: number) => boolean}} look @param {number} radius */
  discs(order, { handOnly, wanted }, radius) {
    const { context, xy, scale } = this;
    context.beginPath();
    for (const i of order) {
      if ((handOnly && i < this.model.faceCount) || (wanted && !wanted(i))) continue;
      const r = radius * scale[i];
      context.moveTo(xy[2 * i] + r, xy[2 * i + 1]);
      context.arc(xy[2 * i], xy[2 * i + 1], r, 0, 2 * Math.PI);
    }
    context.fill();
  }

  /** @param {Numbers} markers @param {boolean} mirror */
  project(markers, mirror) {
    const { centre, height_mm, distance_mm } = this.model.camera;
    const { width, height } = this.canvas;
    const unit = height / height_mm;
    const side = mirror ? -1 : 1;
    for (let i = 0; i < this.scale.length; i++) {
      const s = distance_mm / (distance_mm - (markers[3 * i + 2] - centre[2]));
      this.scale[i] = s;
      this.xy[2 * i] = width / 2 + side * (markers[3 * i] - centre[0]) * s * unit;
      this.xy[2 * i + 1] = height / 2 - (markers[3 * i + 1] - centre[1]) * s * unit;
    }
  }
}

/** Give the canvas as many pixels as the screen shows of it. @param {HTMLCanvasElement} canvas */
function fit(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
return { PointLights, fit };
})();

const $shading = (() => {
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
class Shading {
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
return { Shading };
})();

const $model = (() => {
/**
 * The cuer's body from her parameters: the 113 markers in millimetres, as the paper's algorithms
 * P3DF and P3DH give them (Gibert, Bailly, Elisei 2004, section 3) and as `codec.voice` computes them.
 */

/** Decode base64 of little-endian float64. @param {string} encoded */
function matrix(encoded) {
  const text = atob(encoded);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float64Array(bytes.buffer);
}

/**
 * out = mean + x * axes, x at `offset` of params, axes (n, out.length) row by row.
 * @param {Numbers} mean @param {Numbers} axes @param {Numbers} params @param {number} offset @param {Float64Array} out
 */
function affine(mean, axes, params, offset, out) {
  const width = out.length;
  const n = axes.length / width;
  out.set(mean);
  for (let i = 0; i < n; i++) {
    const x = params[offset + i];
    for (let j = 0, a = i * width; j < width; j++, a++) out[j] += x * axes[a];
  }
}

/**
 * Rotation matrix (row by row, 9 numbers) of the rotation vector `x, y, z` in radians: Rodrigues.
 * @param {number} x @param {number} y @param {number} z @param {Float64Array} out
 */
function rotation(x, y, z, out) {
  const squared = x * x + y * y + z * z;
  const angle = Math.sqrt(squared);
  const s = angle < 1e-6 ? 1 - squared / 6 : Math.sin(angle) / angle;
  const c = angle < 1e-6 ? 0.5 - squared / 24 : (1 - Math.cos(angle)) / squared;
  out[0] = 1 - c * (y * y + z * z);
  out[1] = c * x * y - s * z;
  out[2] = c * x * z + s * y;
  out[3] = c * x * y + s * z;
  out[4] = 1 - c * (x * x + z * z);
  out[5] = c * y * z - s * x;
  out[6] = c * x * z - s * y;
  out[7] = c * y * z + s * x;
  out[8] = 1 - c * (x * x + y * y);
  return out;
}

/**
 * Turn x, y, z by `r`, then add the translation and the pivot, into `to[j..j+2]`.
 * @param {Numbers} r @param {number} x @param {number} y @param {number} z @param {number} tx @param {number} ty
 * @param {number} tz @param {Numbers} pivot @param {Float64Array} to @param {number} j
 */
function move(r, x, y, z, tx, ty, tz, pivot, to, j) {
  to[j] = r[0] * x + r[1] * y + r[2] * z + tx + pivot[0];
  to[j + 1] = r[3] * x + r[4] * y + r[5] * z + ty + pivot[1];
  to[j + 2] = r[6] * x + r[7] * y + r[8] * z + tz + pivot[2];
}

class VoiceModel {
  /** Build from the document of `/voice.json`. @param {VoiceDocument} document */
  constructor(document) {
    this.identity = document.identity;
    this.layout = document.layout;
    this.markers = document.markers;
    this.looks = document.looks || [];
    this.camera = document.camera;
    this.aspect = document.aspect;
    this.movement = document.movement;
    this.rules = document.rules;
    this.pointing = document.pointing;
    this.gestures = decoded(document.gestures);
    this.face = decoded(document.face);
    this.hand = decoded(document.hand);
    this.faceCount = document.face_markers;
    this.handCount = this.markers.length - this.faceCount;
    /** @param {string} prefix */
    const count = (prefix) => this.layout.filter((name) => name.startsWith(prefix)).length;
    this.offsets = { face: 0, hand: count("face."), head: 0, forearm: 0 };
    this.offsets.head = this.offsets.hand + count("hand.");
    this.offsets.forearm = this.offsets.head + count("head.");
    this.placementCount = this.movement.places.length / this.pointing.length;
    this.headMotion = new Float64Array(6);
    this.handMotion = new Float64Array(6);
    this.faceShape = new Float64Array(3 * this.faceCount);
    this.angles = new Float64Array(this.hand.angle_mean.length);
    this.handShape = new Float64Array(3 * this.handCount);
    this.r = new Float64Array(9);
  }

  /**
   * The parameters of a hand that holds a key: numbers of shape and placement; the head is at rest.
   * @param {number} shape @param {number} placement
   */
  target(shape, placement) {
    const { shapes, forearms, head } = this.gestures;
    const { hand, head: headAt, forearm } = this.offsets;
    const params = new Float64Array(this.layout.length);
    const width = params.length - forearm;
    const key = shape * this.placementCount + placement;
    params.set(shapes.subarray(shape * (headAt - hand), (shape + 1) * (headAt - hand)), hand);
    params.set(head, headAt);
    params.set(forearms.subarray(key * width, (key + 1) * width), forearm);
    return params;
  }

  /** Write x, y, z of all markers, face then hand, into `out` (3 numbers a marker). @param {Float64Array} params @param {Float64Array} out */
  reconstruct(params, out) {
    this.reconstructFace(params, out);
    this.reconstructHand(params, out);
    return out;
  }

  /** @param {Float64Array} params @param {Float64Array} out */
  reconstructFace(params, out) {
    const { mean, directions, pivot, motion_mean, motion_directions, weights } = this.face;
    const { headMotion: m, faceShape: p, r } = this;
    affine(motion_mean, motion_directions, params, this.offsets.head, m);
    affine(mean, directions, params, this.offsets.face, p);
    for (let i = 0; i < this.faceCount; i++) {
      const w = weights.subarray(6 * i, 6 * i + 6);
      const j = 3 * i;
      rotation(m[0] * w[0], m[1] * w[1], m[2] * w[2], r);
      move(r, p[j] - pivot[0], p[j + 1] - pivot[1], p[j + 2] - pivot[2],
        m[3] * w[3], m[4] * w[4], m[5] * w[5], pivot, out, j);
    }
  }

  /** @param {Float64Array} params @param {Float64Array} out */
  reconstructHand(params, out) {
    const { angle_mean, angle_directions, regression, pivot, motion_mean, motion_directions } = this.hand;
    const { handMotion: m, handShape: p, angles, r } = this;
    affine(motion_mean, motion_directions, params, this.offsets.forearm, m);
    affine(angle_mean, angle_directions, params, this.offsets.hand, angles);
    const width = p.length;
    const count = angles.length;
    for (let j = 0; j < width; j++) p[j] = regression[j];
    for (let i = 0; i < count; i++) {
      const c = Math.cos(angles[i]);
      const s = Math.sin(angles[i]);
      const a = (1 + i) * width;
      const b = (1 + count + i) * width;
      for (let j = 0; j < width; j++) p[j] += c * regression[a + j] + s * regression[b + j];
    }
    rotation(m[0], m[1], m[2], r);
    for (let j = 0; j < width; j += 3) {
      move(r, p[j], p[j + 1], p[j + 2], m[3], m[4], m[5], pivot, out, 3 * this.faceCount + j);
    }
  }
}

/** @param {Words} arrays */
function decoded(arrays) {
  /** @type {Matrices} */
  const out = {};
  for (const name of Object.keys(arrays)) out[name] = matrix(arrays[name]);
  return out;
}
return { rotation, VoiceModel };
})();

const $skeleton = (() => {
/**
 * The cuer's arm as one chain, and the motions of head and hand with what the rules add: the same
 * as `receiver.drawing.skeleton`. A motion is a rotation vector and a shift; a map `{turn, shift}`
 * has 9 numbers row by row, and 3.
 */

const { rotation } = $model;

const POINTING = 16;
/** Distances in mm: within the first a place's shift holds, beyond the second none does. */
const NEAR_MM = 12;
const FAR_MM = 120;

class Skeleton {
  /** @param {Arrays} arrays */
  constructor(arrays) {
    /** @param {string} name */
    const three = (name) => [0, 3].map((k) => Array.from(arrays[name].subarray(k, k + 3)));
    this.vertices = arrays.joint_vertices;
    this.weights = arrays.joint_weights;
    this.roots = three("joint_roots");
    this.shoulders = three("joint_shoulders");
    this.elbow = Array.from(arrays.joint_elbow);
    this.forearm = mapOf(arrays.joint_forearm);
    this.places = arrays.joint_places;
    this.factors = arrays.joint_factors;
  }

  /** Motions and joints for the pose that `model` has just reconstructed, with what the rules add. @param {Model} model @param {Added} added */
  solve(model, added) {
    const { rules, hand, face } = model;
    const head = mapOf(model.headMotion);
    const still = nodded(model, head, added.nod);
    const turned = vectorOf(still.turn);
    const moved = carried(model, turned, still.shift, (tip) => this.reach(tip));
    const forearm = compose(moved, this.forearm);
    const elbow = apply(forearm, this.elbow);
    const lift = [0, rules.shoulder_breath_mm * (added.breath - rules.breath[0]), 0];
    const follow = elbow.map((x, i) => (x - this.elbow[i]) * rules.shoulder[i]);
    const most = rules.shoulder_most_mm;
    const factor = most / Math.sqrt(most * most + follow.reduce((sum, x) => sum + x * x, 0));
    const { map: right, place: shoulder } = collar(this.roots[0], this.shoulders[0], follow.map((x, i) => factor * x + lift[i]));
    const { map: left } = collar(this.roots[1], this.shoulders[1], lift);
    const upper = bone(this.shoulders[0], this.elbow, shoulder, elbow);
    const gaze = [added.gaze[0] - turned[1], added.gaze[1] + turned[0]];
    const up = rules.lids_per_rad * gaze[1];
    const shapes = { ...added.shapes };
    for (const side of ["Left", "Right"]) {
      shapes[`eyeLookUp${side}`] = Math.max(0, Math.min(1, up));
      shapes[`eyeLookDown${side}`] = Math.max(0, Math.min(1, -up));
    }
    return {
      head: [...turned, ...still.shift],
      hand: [...vectorOf(moved.turn), ...moved.shift.map((x, i) => x - hand.pivot[i])],
      joints: [right, upper, forearm, left],
      shapes, gaze, trunk: added.trunk, pivots: [face.pivot, hand.pivot],
    };
  }

  /** How far a finger tip is shifted, head at rest, where this head's places lie elsewhere. @param {number[]} tip */
  reach(tip) {
    const { places, factors } = this;
    const shift = [0, 0, 0];
    let total = 1 / (FAR_MM * FAR_MM);
    for (let i = 0; i < places.length; i += 3) {
      const squared = tip.reduce((sum, x, k) => sum + (x - places[i + k]) ** 2, 0);
      const weight = 1 / (NEAR_MM * NEAR_MM + squared);
      total += weight;
      for (let k = 0; k < 3; k++) shift[k] += weight * factors[i + k];
    }
    return shift.map((x) => x / total);
  }

  /** Move control vertices by the maps of the joints, in place. @param {Float32Array} control @param {RigidMap[]} joints */
  bend(control, joints) {
    const { vertices, weights } = this;
    for (let i = 0; i < vertices.length; i++) {
      const at = 3 * vertices[i];
      const x = control[at];
      const y = control[at + 1];
      const z = control[at + 2];
      for (let joint = 0; joint < 4; joint++) {
        const weight = weights[4 * i + joint] / 255;
        if (weight === 0) continue;
        const { turn: r, shift: s } = joints[joint];
        control[at] += weight * (r[0] * x + r[1] * y + r[2] * z + s[0] - x);
        control[at + 1] += weight * (r[3] * x + r[4] * y + r[5] * z + s[1] - y);
        control[at + 2] += weight * (r[6] * x + r[7] * y + r[8] * z + s[2] - z);
      }
    }
  }
}

/** The head's motion about its pivot, with a turn about the top of the neck. @param {Model} model @param {RigidMap} head @param {number[]} nod */
function nodded(model, head, nod) {
  const neck = model.rules.neck_mm.map((x, i) => x - model.face.pivot[i]);
  return compose(about(neck, nod, [0, 0, 0]), head);
}

/**
 * The hand's map in the world after it followed the skin at which it points.
 * @param {Model} model @param {number[]} turn @param {number[]} shift @param {(tip: number[]) => number[]} reach
 */
function carried(model, turn, shift, reach) {
  const { hand, handMotion, headMotion, markers, handShape, faceCount, rules, face } = model;
  const before = mapOf(handMotion);
  before.shift = before.shift.map((x, i) => x + hand.pivot[i]);
  /** @param {string} name */
  const place = (name) => {
    const j = 3 * (markers.indexOf(name) - faceCount);
    return apply(before, Array.from(handShape.subarray(j, j + 3)));
  };
  const wrist = place("W1");
  const tips = ["F2T", "F3T"].map(place);
  const far = tips.map((tip) => Math.hypot(...tip.map((x, i) => x - wrist[i])) ** POINTING);
  const tip = tips[0].map((x, i) => (far[0] * x + far[1] * tips[1][i]) / (far[0] + far[1]));
  const [w, v] = [1, 2].map((k) => interpolate(tip[1], rules.throat, k));
  /** @param {number[]} r @param {number[]} s */
  const share = (r, s) => about(face.pivot, r.map((x) => w * x), s.map((x) => v * x));
  const old = share(Array.from(headMotion.subarray(0, 3)), Array.from(headMotion.subarray(3, 6)));
  const away = inverse(old);
  const there = reach(apply(away, tip));
  const still = { turn: away.turn, shift: away.shift.map((x, i) => x + there[i]) };
  return compose(compose(share(turn, shift), still), before);
}

/** @param {number} x @param {number[][]} table @param {number} column */
function interpolate(x, table, column) {
  if (x <= table[0][0]) return table[0][column];
  for (let i = 1; i < table.length; i++) {
    const [low, high] = [table[i - 1], table[i]];
    if (x <= high[0]) return low[column] + (x - low[0]) / (high[0] - low[0]) * (high[column] - low[column]);
  }
  return table[table.length - 1][column];
}

/**
 * The map of a collar bone whose end moves by about `moved`, and where its end is.
 * @param {number[]} root @param {number[]} end @param {number[]} moved
 */
function collar(root, end, moved) {
  const way = end.map((x, i) => x + moved[i] - root[i]);
  const factor = Math.hypot(...end.map((x, i) => x - root[i])) / Math.hypot(...way);
  const place = way.map((x, i) => root[i] + factor * x);
  return { map: bone(root, end, root, place), place };
}

/**
 * The map of a bone: turned the short way and stretched along its axis.
 * @param {number[]} start @param {number[]} end @param {number[]} newStart @param {number[]} newEnd
 */
function bone(start, end, newStart, newEnd) {
  const before = end.map((x, i) => x - start[i]);
  const after = newEnd.map((x, i) => x - newStart[i]);
  const length = Math.hypot(...before);
  const reach = Math.hypot(...after);
  const a = before.map((x) => x / length);
  const b = after.map((x) => x / reach);
  const [x, y, z] = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const c = 1 / (1 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
  const turn = [
    1 - c * (y * y + z * z), c * x * y - z, c * x * z + y,
    c * x * y + z, 1 - c * (x * x + z * z), c * y * z - x,
    c * x * z - y, c * y * z + x, 1 - c * (x * x + y * y),
  ];
  const stretch = reach / length - 1;
  const linear = times(turn, [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) => (i === j ? 1 : 0) + stretch * a[i] * a[j])));
  const moved = apply({ turn: linear, shift: [0, 0, 0] }, start);
  return { turn: linear, shift: newStart.map((value, i) => value - moved[i]) };
}

/** @param {Numbers} motion */
function mapOf(motion) {
  return { turn: rotation(motion[0], motion[1], motion[2], new Float64Array(9)), shift: [motion[3], motion[4], motion[5]] };
}

/** A rotation about `pivot` and a shift, as a map about the origin. @param {Numbers} pivot @param {number[]} vector @param {number[]} shift */
function about(pivot, vector, shift) {
  const turn = rotation(vector[0], vector[1], vector[2], new Float64Array(9));
  const moved = apply({ turn, shift: [0, 0, 0] }, pivot);
  return { turn, shift: shift.map((x, i) => x + pivot[i] - moved[i]) };
}

/** @param {RigidMap} map @param {Numbers} point */
function apply({ turn: r, shift: s }, point) {
  const [x, y, z] = point;
  return [0, 3, 6].map((k, i) => r[k] * x + r[k + 1] * y + r[k + 2] * z + s[i]);
}

/** @param {Numbers} a @param {Numbers} b */
function times(a, b) {
  return [0, 3, 6].flatMap((i) => [0, 1, 2].map((j) => a[i] * b[j] + a[i + 1] * b[j + 3] + a[i + 2] * b[j + 6]));
}

/** The map that does `before`, then `after`. @param {RigidMap} after @param {RigidMap} before */
function compose(after, before) {
  return { turn: times(after.turn, before.turn), shift: apply(after, before.shift) };
}

/** @param {RigidMap} map */
function inverse({ turn: r, shift }) {
  const turn = [0, 1, 2].flatMap((i) => [r[i], r[i + 3], r[i + 6]]);
  return { turn, shift: apply({ turn, shift: [0, 0, 0] }, shift).map((x) => -x) };
}

/** Rotation vector of a matrix; angles stay well below a half turn. @param {Numbers} r */
function vectorOf(r) {
  const axis = [r[7] - r[5], r[2] - r[6], r[3] - r[1]];
  const sine = Math.hypot(...axis) / 2;
  const angle = Math.atan2(sine, (r[0] + r[4] + r[8] - 1) / 2);
  const factor = sine < 1e-9 ? 0.5 : angle / (2 * sine);
  return axis.map((x) => factor * x);
}
return { Skeleton };
})();

const $avatar = (() => {
/**
 * The avatar: a skin that follows the markers, drawn with WebGL.
 *
 * A linear map gives a coarse mesh from the markers before head and forearm move them; a finer
 * surface lies over it; the graphics processor moves both parts rigidly and lights them. The same
 * numbers as `receiver.avatar`, the same light as `receiver.portrait`.
 */

const { Movement } = $movement;
const { Mouth } = $mouth;
const { fit } = $points;
const { Shading } = $shading;
const { Skeleton } = $skeleton;

/** @type {Record<string, any>} */
const KINDS = { f4: Float32Array, i2: Int16Array, u2: Uint16Array, u1: Uint8Array };
const SHARE_UNIT = 252;
const OFFSET_UNIT = 256;
const ORIGIN = [0, 0, 0];
/** Decode `/avatar.bin`: `{name: typed array}`. @param {ArrayBuffer} buffer */
function parseAvatar(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  /** @type {Arrays} */
  const arrays = {};
  for (const [name, kind, offset, size] of header) arrays[name] = new KINDS[kind](buffer, 4 + length + offset, size);
  return arrays;
}

/** Head or hand: markers to vertices and normals. */
class Surface {
  /** @type {any} Only the head has eyes, a mouth and a skeleton. */
  eyes = null;
  /** @type {any} */
  mouth = null;
  /** @type {any} */
  skeleton = null;
  changing = new Uint32Array();
  moving = new Uint32Array();
  isMoving = new Uint8Array();
  movingTriangles = new Uint16Array();

  /** @param {Arrays} arrays @param {string} prefix */
  constructor(arrays, prefix) {
    /** @param {string} name */
    const part = (name) => arrays[`${prefix}_${name}`];
    this.markers = part("markers");
    this.rest = part("rest");
    this.coefficients = part("coefficients");
    this.basis = part("basis");
    this.movingControl = part("moving");
    this.sources = part("sources");
    this.triangles = part("triangles");
    this.colours = part("colours");
    this.shares = Float32Array.from(part("shares"), (share) => share / SHARE_UNIT);
    this.offsets = Float32Array.from(part("offsets"), (offset) => offset / OFFSET_UNIT);
    this.rank = this.coefficients.length / this.markers.length;
    this.count = this.sources.length / 3;
    this.control = Float32Array.from(this.rest);
    this.position = new Float32Array(3 * this.count);
    this.normal = new Float32Array(3 * this.count);
    this.weight = new Float64Array(this.rank);
    /** @type {Record<string, {vertices: TypedArray, deltas: TypedArray}>} */
    this.shapes = {};
    if (prefix === "head") {
      this.mouth = new Mouth(arrays);
      this.skeleton = new Skeleton(arrays);
      const ranges = arrays.eye_ranges;
      const vertices = [0, 2].flatMap((k) => Array.from({ length: ranges[k + 1] }, (_, i) => ranges[k] + i));
      this.eyes = { ranges, vertices, middles: arrays.eye_middles };
      for (const name of Object.keys(arrays)) {
        const [kind, shape] = name.split(".");
        if (kind === "shape") this.shapes[shape] = { vertices: arrays[name], deltas: arrays[`deltas.${shape}`] };
      }
    }
    this.findMoving();
    this.refine(Array.from({ length: this.count }, (_, i) => i));
    this.turnNormals(this.triangles, new Uint8Array(this.count).fill(1));
  }

  /** Note which vertices markers and shapes move; the others and their triangles are computed once. */
  findMoving() {
    const moves = new Uint8Array(this.rest.length / 3);
    for (const vertex of this.movingControl) moves[vertex] = 1;
    for (const shape of Object.values(this.shapes)) for (const vertex of shape.vertices) moves[vertex] = 1;
    if (this.skeleton) for (const vertex of this.skeleton.vertices) moves[vertex] = 1;
    // Shapes add to what is there: every vertex that anything moves begins again at rest.
    this.changing = Uint32Array.from(moves.keys()).filter((i) => moves[i]);
    /** @param {number} i */
    const carried = (i) => moves[this.sources[3 * i]] || moves[this.sources[3 * i + 1]] || moves[this.sources[3 * i + 2]];
    this.isMoving = Uint8Array.from({ length: this.count }, (_, i) => (carried(i) ? 1 : 0));
    this.moving = Uint32Array.from(this.isMoving.keys()).filter((i) => this.isMoving[i]);
    const near = [];
    for (let t = 0; t < this.triangles.length; t += 3) {
      const corners = this.triangles.subarray(t, t + 3);
      if (corners.some((i) => this.isMoving[i])) near.push(...corners);
    }
    this.movingTriangles = Uint16Array.from(near);
  }

  /**
   * Bend the surface to `markers` (before their rigid motion), by blend shapes `{name: weight}`,
   * the eyes' `gaze`, radians to the viewer's right and up, and the maps of the joints.
   * @param {Numbers} markers @param {Record<string, number>} [weights] @param {number[]} [gaze]
   * @param {RigidMap[]|null} [joints]
   */
  bend(markers, weights = {}, gaze = [0, 0], joints = null) {
    const { weight, rank, coefficients, basis, rest, control, movingControl } = this;
    weight.fill(0);
    for (let i = 0; i < this.markers.length; i++) {
      const moved = markers[i] - this.markers[i];
      for (let r = 0, a = i * rank; r < rank; r++, a++) weight[r] += moved * coefficients[a];
    }
    for (const vertex of this.changing) {
      for (let j = 3 * vertex; j < 3 * vertex + 3; j++) control[j] = rest[j];
    }
    const size = 3 * movingControl.length;
    for (let i = 0; i < movingControl.length; i++) {
      const j = 3 * movingControl[i];
      for (let r = 0, a = 3 * i; r < rank; r++, a += size) {
        control[j] += weight[r] * basis[a];
        control[j + 1] += weight[r] * basis[a + 1];
        control[j + 2] += weight[r] * basis[a + 2];
      }
    }
    for (const [name, share] of Object.entries(weights)) {
      if (share === 0) continue;
      const { vertices, deltas } = this.shapes[name];
      for (let k = 0; k < vertices.length; k++) {
        for (let c = 0; c < 3; c++) control[3 * vertices[k] + c] += (share / OFFSET_UNIT) * deltas[3 * k + c];
      }
    }
    this.mouth?.solve(control);
    if (joints) this.skeleton.bend(control, joints);
    this.refine(this.moving);
    if (this.eyes && (gaze[0] !== 0 || gaze[1] !== 0 || this.hasTurned)) this.turnEyes(gaze);
    this.turnNormals(this.movingTriangles, this.isMoving);
  }

  /** Turn the eyeballs; a ball keeps its normals. @param {number[]} gaze */
  turnEyes(gaze) {
    const [yaw, pitch] = gaze;
    const { position, eyes } = this;
    this.hasTurned = yaw !== 0 || pitch !== 0;
    this.refine(eyes.vertices);
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    for (let eye = 0; eye < 2; eye++) {
      const [mx, my, mz] = eyes.middles.subarray(3 * eye, 3 * eye + 3);
      const end = 3 * (eyes.ranges[2 * eye] + eyes.ranges[2 * eye + 1]);
      for (let j = 3 * eyes.ranges[2 * eye]; j < end; j += 3) {
        const x = position[j] - mx;
        const y = position[j + 1] - my;
        const z = position[j + 2] - mz;
        const ahead = cp * z - sp * y;
        position[j] = mx + cy * x + sy * ahead;
        position[j + 1] = my + cp * y + sp * z;
        position[j + 2] = mz + cy * ahead - sy * x;
      }
    }
  }

  /** Place the vertices of the surface over the coarse mesh. @param {Iterable<number>} which */
  refine(which) {
    const { control, sources, shares, offsets, position } = this;
    for (const i of which) {
      const j = 3 * i;
      const a = 3 * sources[j];
      const b = 3 * sources[j + 1];
      const c = 3 * sources[j + 2];
      const u = shares[j];
      const v = shares[j + 1];
      const w = shares[j + 2];
      position[j] = u * control[a] + v * control[b] + w * control[c] + offsets[j];
      position[j + 1] = u * control[a + 1] + v * control[b + 1] + w * control[c + 1] + offsets[j + 1];
      position[j + 2] = u * control[a + 2] + v * control[b + 2] + w * control[c + 2] + offsets[j + 2];
    }
  }

  /** Sum the area vectors of `triangles` at those of their corners that are `wanted` (1 or 0). @param {Numbers} triangles @param {Numbers} wanted */
  turnNormals(triangles, wanted) {
    const { position: p, normal } = this;
    for (let i = 0, j = 0; j < normal.length; i++, j += 3) {
      if (wanted[i] === 1) normal[j] = normal[j + 1] = normal[j + 2] = 0;
    }
    for (let t = 0; t < triangles.length; t += 3) {
      const i = triangles[t];
      const j = triangles[t + 1];
      const k = triangles[t + 2];
      const a = 3 * i;
      const b = 3 * j;
      const c = 3 * k;
      const ax = p[a];
      const ay = p[a + 1];
      const az = p[a + 2];
      const ux = p[b] - ax;
      const uy = p[b + 1] - ay;
      const uz = p[b + 2] - az;
      const vx = p[c] - ax;
      const vy = p[c + 1] - ay;
      const vz = p[c + 2] - az;
      const nx = uy * vz - uz * vy;
      const ny = uz * vx - ux * vz;
      const nz = ux * vy - uy * vx;
      if (wanted[i] === 1) {
        normal[a] += nx;
        normal[a + 1] += ny;
        normal[a + 2] += nz;
      }
      if (wanted[j] === 1) {
        normal[b] += nx;
        normal[b + 1] += ny;
        normal[b + 2] += nz;
      }
      if (wanted[k] === 1) {
        normal[c] += nx;
        normal[c + 1] += ny;
        normal[c + 2] += nz;
      }
    }
  }
}

class AvatarView {
  /** @type {any} */
  head;
  /** @type {any} */
  hand;

  /** Build on a canvas; throws where WebGL is missing. @param {HTMLCanvasElement} canvas @param {Model} model @param {Arrays} arrays */
  constructor(canvas, model, arrays) {
    this.canvas = canvas;
    this.model = model;
    const wish = { alpha: true, antialias: true, premultipliedAlpha: true };
    const gl = /** @type {GL | null} */ (canvas.getContext("webgl2", wish) || canvas.getContext("webgl", wish));
    if (!gl) throw new Error("WebGL is missing");
    this.gl = gl;
    this.movement = new Movement(model);
    this.shading = new Shading(gl, arrays, model.camera.height_mm);
    this.wear(arrays);
  }

  /** Draw the surfaces of another look of the same cuer from now on; those before leave the graphics memory. @param {Arrays} arrays */
  wear(arrays) {
    const before = this.head ? [...this.head.buffers, ...this.hand.buffers] : [];
    this.head = this.upload(new Surface(arrays, "head"), arrays.head_weights);
    this.hand = this.upload(new Surface(arrays, "hand"), null);
    for (const buffer of before) this.gl.deleteBuffer(buffer);
  }

  /** @param {Surface} surface @param {TypedArray|null} weights */
  upload(surface, weights) {
    const { gl } = this;
    const count = surface.count;
    const colour = new Uint8Array(4 * count);
    const extra = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 4; k++) colour[4 * i + k] = surface.colours[5 * i + k];
      extra[3 * i] = surface.colours[5 * i + 4] / 255;
      extra[3 * i + 1] = weights ? weights[2 * i] : 1;
      extra[3 * i + 2] = weights ? weights[2 * i + 1] : 1;
    }
    /** @type {WebGLBuffer[]} */
    const buffers = [];
    /** @param {number} target @param {AllowSharedBufferSource} data @param {number} usage */
    const buffer = (target, data, usage) => {
      const made = gl.createBuffer();
      buffers.push(made);
      gl.bindBuffer(target, made);
      gl.bufferData(target, data, usage);
      return made;
    };
    const [opaque, clear] = sortTriangles(surface);
    return {
      surface,
      buffers,
      position: buffer(gl.ARRAY_BUFFER, surface.position, gl.DYNAMIC_DRAW),
      normal: buffer(gl.ARRAY_BUFFER, surface.normal, gl.DYNAMIC_DRAW),
      colour: buffer(gl.ARRAY_BUFFER, colour, gl.STATIC_DRAW),
      extra: buffer(gl.ARRAY_BUFFER, extra, gl.STATIC_DRAW),
      index: buffer(gl.ELEMENT_ARRAY_BUFFER, Uint16Array.from([...opaque, ...clear]), gl.STATIC_DRAW),
      opaque: [0, opaque.length],
      clear: [opaque.length, clear.length],
    };
  }

  /**
   * Draw the model as it was last reconstructed; `look`: {alpha, mirror, handOnly}. Face and trunk
   * move by the parameters of the seconds before: `sample(timeS, out)` writes those.
   * @param {number} timeS @param {Look} look @param {Sample} sample
   */
  draw(timeS, look, sample) {
    const { gl, canvas, model, head, hand, shading } = this;
    fit(canvas);
    const parts = look.handOnly ? [hand] : [head, hand];
    this.pose = head.surface.skeleton.solve(model, this.movement.at(timeS, sample));
    head.surface.bend(model.faceShape, this.pose.shapes, this.pose.gaze, this.pose.joints);
    hand.surface.bend(model.handShape);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.frontFace(look.mirror ? gl.CW : gl.CCW);
    for (const part of parts) {
      for (const name of ["position", "normal"]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, part[name]);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, part.surface[name]);
      }
    }
    const frame = [2 * canvas.height / canvas.width, model.camera.distance_mm, look.mirror ? -1 : 1];
    if (!look.handOnly) {
      shading.castShadow((program) => {
        this.choosePart(program, hand, frame);
        this.drawPart(hand.opaque);
        this.drawPart(hand.clear);
      });
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (look.alpha <= 0) return;
    const { skin } = shading;
    gl.useProgram(skin.handle);
    gl.uniform1f(skin.uniforms.alpha, look.alpha);
    for (const kind of ["opaque", "clear"]) {
      for (const part of parts) {
        if (part[kind][1] === 0) continue;
        gl.uniform1f(skin.uniforms.receives, part === hand ? 0 : 1);
        this.choosePart(skin, part, frame);
        this.drawPart(part[kind]);
      }
    }
  }

  /** Set the part to be drawn: its place and its vertices. @param {Program} program @param {Uploaded} part @param {number[]} frame */
  choosePart(program, part, frame) {
    const { gl, model, pose } = this;
    // The face model keeps its points in the world, the hand model about its pivot.
    const [motion, base, pivot] = part === this.hand
      ? [pose.hand, ORIGIN, model.hand.pivot] : [pose.head, model.face.pivot, model.face.pivot];
    // The figure leans about the lower back (`receiver.drawing.movement.lean`).
    const [side, , front] = pose.trunk.map((/** @type {number} */ x) => x / model.rules.lean_mm);
    const centre = model.camera.centre.map((x, i) => x - pose.trunk[i]);
    const set = { turn: motion.slice(0, 3), shift: motion.slice(3, 6), base, pivot, centre, frame, lean: [front, 0, -side], head: model.face.pivot };
    for (const [name, value] of Object.entries(set)) gl.uniform3fv(program.uniforms[name], value);
    /** @param {"position" | "normal" | "colour" | "extra"} name @param {number} size @param {number} type @param {boolean} normalised */
    const bind = (name, size, type, normalised) => {
      if (program.attributes[name] === undefined) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, part[name]);
      gl.enableVertexAttribArray(program.attributes[name]);
      gl.vertexAttribPointer(program.attributes[name], size, type, normalised, 0, 0);
    };
    bind("position", 3, gl.FLOAT, false);
    bind("normal", 3, gl.FLOAT, false);
    bind("colour", 4, gl.UNSIGNED_BYTE, true);
    bind("extra", 3, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.index);
  }

  /** @param {Indices} range */
  drawPart(range) {
    const [first, count] = range;
    this.gl.drawElements(this.gl.TRIANGLES, count, this.gl.UNSIGNED_SHORT, 2 * first);
  }
}

/** Corners of the opaque triangles, and of those with a transparent corner, in their order. @param {Surface} surface */
function sortTriangles({ triangles, colours }) {
  /** @type {number[]} */
  const opaque = [];
  /** @type {number[]} */
  const clear = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = triangles.subarray(t, t + 3);
    (corners.some((i) => colours[5 * i + 4] < 255) ? clear : opaque).push(...corners);
  }
  return [opaque, clear];
}
return { parseAvatar, Surface, AvatarView };
})();

const $clock = (() => {
/**
 * The programme's clock as the viewer sees it: the media time of the picture that stands on the
 * screen when what is drawn now appears there, one refresh later.
 *
 * While the video plays, presented frames tell their media time and the instant at which they
 * appear; between them the clock runs at the playback rate. When frames fail to come it goes on
 * with `currentTime`, which stands still when the media ran dry, and keeps the distance that both
 * had before. Without any frames (paused, no picture, an old browser) it is `currentTime`.
 */

const STALE_MS = 80;
const DISTANCE_SHARE = 0.1;
const USUAL_REFRESH_MS = 1000 / 60;
const FASTEST_REFRESH_MS = 4;

class ProgrammeClock {
  /** @param {HTMLVideoElement} video */
  constructor(video) {
    this.video = video;
    /** @type {{mediaS: number, shownMs: number} | null} */
    this.frame = null;
    this.distanceS = 0;
    this.refreshMs = USUAL_REFRESH_MS;
    this.beforeMs = NaN;
    for (const name of ["seeking", "pause", "ratechange", "emptied"]) {
      video.addEventListener(name, () => this.forget());
    }
    if ("requestVideoFrameCallback" in video) this.follow();
  }

  forget() {
    this.frame = null;
    this.distanceS = 0;
  }

  follow() {
    this.video.requestVideoFrameCallback((now, metadata) => {
      if (!this.video.paused && !this.video.seeking) {
        this.frame = { mediaS: metadata.mediaTime, shownMs: metadata.expectedDisplayTime };
      }
      this.follow();
    });
  }

  /** Media time in seconds for what is drawn at `nowMs`, the page's time of this refresh. @param {number} nowMs */
  at(nowMs) {
    const { video, frame } = this;
    const step = nowMs - this.beforeMs;
    this.beforeMs = nowMs;
    // Late refreshes take several periods: only the shorter ones say what the period is.
    if (step > FASTEST_REFRESH_MS && step < 1.5 * this.refreshMs) this.refreshMs += 0.1 * (step - this.refreshMs);
    if (!frame || video.paused || video.seeking) return video.currentTime;
    const agoMs = nowMs - frame.shownMs;
    if (agoMs > STALE_MS) return video.currentTime + this.distanceS;
    const timeS = frame.mediaS + Math.max(0, agoMs + this.refreshMs) / 1000 * video.playbackRate;
    this.distanceS += DISTANCE_SHARE * (timeS - video.currentTime - this.distanceS);
    return timeS;
  }
}
return { ProgrammeClock };
})();

const $keys = (() => {
/** The numbers of hand placements, as `codec.score.PLACEMENTS` orders them. */

/** @type {Record<string, number>} */
const PLACEMENT_NUMBER = { rest: 0, side: 1, mouth: 2, chin: 3, cheek: 4, throat: 5 };

/**
 * Share of a stroke after which the hand is nearer to the new key than to the old one: where the
 * fingers alone change, which run ahead, where the place alone does, and where both do.
 */
const CROSSED = { shape: 0.42, place: 0.56, both: 0.47 };

/** Share of the consonant in a key of two phones, as cuers speak. */
const CONSONANT = 0.5;

/** Share of the way to rest at which the hand shows its key no more. */
const GONE = 0.3;

/** A time before any that occurs, seconds. */
const LONG_AGO_S = -1e6;

const REST = { shape: 0, placement: "rest", leave: LONG_AGO_S, reach: LONG_AGO_S };

/**
 * The hand's strokes to `keys`, in order: each key's `{shape, placement, leave, reach}`, seconds.
 *
 * The rule of `codec.superframe.resynthesis.movements`; `movement` has the voice's constants of
 * `codec.cuer.movement` and `places`, where its hand is for each key, mm.
 * @param {Key[]} keys @param {HandMovement} movement
 */
function strokesTo(keys, movement) {
  /** @type {Stroke[]} */
  const strokes = [];
  let last = REST;
  keys.forEach((key, i) => {
    const before = keys[i - 1];
    const gap = before ? key.start - before.end : Infinity;
    const rested = gap >= movement.rest_gap_s;
    const lead = rested ? Math.min(movement.first_lead_s, gap / 2) : 0;
    if (rested && before) last = strokeToRest(before, last, key.start - lead, movement);
    const way = distance(last, key, movement.places);
    const leave = key.start - (rested ? lead : leadOf(key.start - before.start, way, movement));
    const lag = key.phones.length > 1 ? movement.lag_share * CONSONANT * (key.end - key.start) : 0;
    last = strokeTo(key, last, leave, key.start + lag, way, movement);
    strokes.push(last);
  });
  return strokes;
}

/** When the hand begins to show the key of a stroke, seconds: it runs ahead of the lips. @param {Stroke} stroke @param {Stroke} [before] */
function shownFrom(stroke, before = REST) {
  const turns = stroke.shape !== before.shape;
  const goes = stroke.placement !== before.placement;
  const share = CROSSED[turns && goes ? "both" : goes ? "place" : "shape"];
  return stroke.leave + share * (stroke.reach - stroke.leave);
}

/** When the hand shows a key no more, if it goes to rest after it, seconds. @param {Key} key @param {Stroke} stroke @param {HandMovement} movement */
function shownUntil(key, stroke, movement) {
  const rest = strokeToRest(key, stroke, Infinity, movement);
  return rest.leave + GONE * (rest.reach - rest.leave);
}

/** @param {number} apart @param {number} way @param {HandMovement} movement */
function leadOf(apart, way, movement) {
  const quick = Math.min(apart, movement.hurried_s);
  const most = movement.most_lead_s + movement.lead_s_per_mm * way;
  const lead = movement.lead_share * quick + movement.calm_share * (apart - quick);
  return Math.max(Math.min(lead, most), movement.least_lead_s);
}

/** @param {Key} key @param {Stroke} last @param {number} leave @param {number} target @param {number} way @param {HandMovement} movement */
function strokeTo({ shape, placement }, last, leave, target, way, movement) {
  const least = 1.875 * way / (1000 * movement.fastest_m_s);
  leave = Math.max(Math.min(leave, target - least), freeAfter(last, movement));
  const late = Math.min(leave + least, target + movement.late_s);
  return { shape, placement, leave, reach: Math.max(target, late, leave + movement.shortest_s) };
}

/** @param {Key} key @param {Stroke} last @param {number} until @param {HandMovement} movement */
function strokeToRest(key, last, until, movement) {
  const leave = Math.max(key.end + movement.rest_delay_s, freeAfter(last, movement));
  const reach = Math.max(Math.min(leave + movement.rest_move_s, until), leave + movement.shortest_s);
  return { ...REST, leave, reach };
}

/** @param {Stroke} stroke @param {HandMovement} movement */
function freeAfter(stroke, movement) {
  return stroke.reach - movement.overlap * (stroke.reach - stroke.leave);
}

/** @param {HandKey} one @param {HandKey} other @param {number[][]} places */
function distance(one, other, places) {
  const from = places[6 * one.shape + PLACEMENT_NUMBER[one.placement]];
  const to = places[6 * other.shape + PLACEMENT_NUMBER[other.placement]];
  return Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
}
return { PLACEMENT_NUMBER, strokesTo, shownFrom, shownUntil };
})();

const $hand = (() => {
/** Which key the drawn hand shows: the nearest of the voice's hand shapes and placements. */

const { PLACEMENT_NUMBER } = $keys;
const { rotation } = $model;

const PLACEMENTS = Object.keys(PLACEMENT_NUMBER);

/** The placement at which shapes are compared: every shape occurs there. */
const SIDE = PLACEMENT_NUMBER.side;

class HandReader {
  /** @param model a `VoiceModel`, whose gesture table tells its targets @param {Model} model */
  constructor(model) {
    this.model = model;
    /** @param {RegExp} pattern */
    const numbers = (pattern) => model.markers.flatMap((name, i) => (pattern.test(name) ? [3 * i] : []));
    this.tips = numbers(/^F\dT$/);
    this.anchors = [...this.tips, ...numbers(/^K\d$/)];
    this.pointing = model.pointing.map((name) => 3 * model.markers.indexOf(name));
    this.form = new Float64Array(this.tips.length * this.anchors.length);
    this.turn = new Float64Array(9);
    /** @type {Float64Array[]} */
    this.forms = [];
    /** @type {number[][][]} */
    this.places = [];
    const markers = new Float64Array(3 * model.markers.length);
    model.pointing.forEach((_name, shape) => {
      this.places.push(PLACEMENTS.map((_place, placement) => {
        model.reconstruct(model.target(shape, placement), markers);
        if (placement === SIDE) this.forms.push(Float64Array.from(this.formOf(markers)));
        return this.pointedAt(shape, markers);
      }));
    });
  }

  /** The key `{shape, placement}` that is nearest to the markers that `model` has just reconstructed. @param {Float64Array} markers */
  read(markers) {
    const form = this.formOf(markers);
    const shape = nearest(this.forms, form);
    return { shape, placement: PLACEMENTS[nearest(this.places[shape], this.pointedAt(shape, markers))] };
  }

  /** What a hand's shape is told by, wherever it is: distances between finger tips, and from them to the knuckles. @param {Float64Array} markers */
  formOf(markers) {
    let n = 0;
    for (const a of this.tips) {
      for (const b of this.anchors) {
        this.form[n++] = Math.hypot(markers[a] - markers[b], markers[a + 1] - markers[b + 1], markers[a + 2] - markers[b + 2]);
      }
    }
    return this.form;
  }

  /** Where the pointing finger of a shape is for a head at rest, mm. @param {number} shape @param {Float64Array} markers */
  pointedAt(shape, markers) {
    const { headMotion: m, face } = this.model;
    const r = rotation(m[0], m[1], m[2], this.turn);
    const [x, y, z] = [0, 1, 2].map((i) => markers[this.pointing[shape] + i] - m[3 + i] - face.pivot[i]);
    return [0, 1, 2].map((i) => r[i] * x + r[3 + i] * y + r[6 + i] * z + face.pivot[i]);
  }
}

/** Index of the row that is nearest to `point`. @param {Numbers[]} rows @param {Numbers} point */
function nearest(rows, point) {
  let best = 0;
  let least = Infinity;
  rows.forEach((row, number) => {
    let sum = 0;
    for (let i = 0; i < row.length; i++) sum += (row[i] - point[i]) ** 2;
    if (sum < least) [best, least] = [number, sum];
  });
  return best;
}
return { HandReader };
})();

const $timeline = (() => {
/**
 * The cuer's parameters over the programme's clock: pieces of motion in any order, sampled anywhere.
 *
 * A piece is `{startS, rateHz, count, width, frames, concealed, layers}`; `frames` holds
 * count x width numbers. Pieces that join within half a frame are interpolated across the joint.
 */

const { shownFrom, shownUntil, strokesTo } = $keys;

const HOLD_S = 0.35;
const FADE_S = 0.45;
const KEPT_S = 300;

/** How far from the present keys can bear on what the hand shows, seconds. */
const NEAR_S = 4;

/** How far the drawn hand may be ahead of its clock or behind, seconds. */
const SLACK_S = 0.25;

class Timeline {
  /** @param movement constants of the voice's hand, from `/voice.json` @param {HandMovement} movement */
  constructor(movement) {
    this.movement = movement;
    /** @type {Piece[]} */
    this.pieces = [];
    /** @type {Key[]} */
    this.keys = [];
    /** @type {StateChange[]} */
    this.states = [];
  }

  clear() {
    this.pieces.length = 0;
    this.keys = [];
    this.states = [];
  }

  /** Note a change of state `{time_s, state}`; what was known of later times is out of date. @param {StateChange} change */
  insertState(change) {
    this.states = this.states.filter((known) => known.time_s < change.time_s);
    this.states.push(change);
  }

  /** The state of reception at `timeS`; undefined before the first. @param {number} timeS */
  stateAt(timeS) {
    let state;
    for (const change of this.states) if (change.time_s <= timeS) state = change.state;
    return state;
  }

  /** Insert a piece; one that covers the same time is replaced if the new one is at least as good. @param {Piece} piece */
  insert(piece) {
    const half = 0.5 * piece.count / piece.rateHz;
    const low = this.indexAfter(piece.startS - half);
    while (low < this.pieces.length && this.pieces[low].startS < piece.startS + half) {
      if (this.pieces[low].layers > piece.layers) return;
      this.pieces.splice(low, 1);
    }
    this.pieces.splice(low, 0, piece);
  }

  /** Add keys, each once: the key that starts at the same hundredth of a second is replaced. @param {Key[]} keys */
  insertKeys(keys) {
    for (const key of keys) {
      const low = this.keys.findIndex((known) => known.start > key.start - 0.01);
      if (low < 0) this.keys.push(key);
      else this.keys.splice(low, Math.abs(this.keys[low].start - key.start) < 0.01 ? 1 : 0, key);
    }
  }

  /** Forget what lies further than five minutes from `timeS`: memory does not grow with the programme. @param {number} timeS */
  prune(timeS) {
    /** @param {number} start */
    const near = (start) => Math.abs(start - timeS) < KEPT_S;
    if (this.pieces.length && !(near(this.pieces[0].startS) && near(this.pieces[this.pieces.length - 1].startS))) {
      this.pieces = this.pieces.filter((piece) => near(piece.startS));
      this.keys = this.keys.filter((key) => near(key.start));
      this.states = this.states.slice(-100);
    }
  }

  /** Index of the first piece that starts after `timeS`. @param {number} timeS */
  indexAfter(timeS) {
    let low = 0;
    let high = this.pieces.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.pieces[middle].startS <= timeS) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Seconds of motion known without a break from `timeS` on. @param {number} timeS */
  knownFrom(timeS) {
    let index = this.indexAfter(timeS) - 1;
    let end = timeS;
    for (; index >= 0 && index < this.pieces.length; index++) {
      const piece = this.pieces[index];
      if (piece.startS > end + 0.5 / piece.rateHz) break;
      end = Math.max(end, piece.startS + piece.count / piece.rateHz);
    }
    return end - timeS;
  }

  /**
   * Write the parameters at `timeS` into `out` by cubic interpolation.
   *
   * Returns the visibility of the cuer, 0 to 1: inside known motion 1; behind its end the last
   * frame is held and then faded out; 0 where nothing is known (`out` is then left alone).
   * @param {number} timeS @param {Float64Array} out
   */
  sample(timeS, out) {
    const index = this.indexAfter(timeS) - 1;
    if (index < 0) return 0;
    const piece = this.pieces[index];
    const position = (timeS - piece.startS) * piece.rateHz;
    const late = position / piece.rateHz - piece.count / piece.rateHz;
    if (late > HOLD_S + FADE_S) return 0;
    const at = Math.min(Math.floor(position), piece.count - 1);
    const x = Math.min(position - at, late > 0 ? 0 : 1);
    cubic(this.row(index, at - 1), this.row(index, at), this.row(index, at + 1), this.row(index, at + 2), x, out);
    return late <= HOLD_S ? 1 : 1 - (late - HOLD_S) / FADE_S;
  }

  /** Frame `at` counted from piece `index`, from its neighbours where they join, else the nearest. @param {number} index @param {number} at */
  row(index, at) {
    let piece = this.pieces[index];
    const other = at < 0 ? this.pieces[index - 1] : at >= piece.count ? this.pieces[index + 1] : undefined;
    if (other && other.width === piece.width && other.rateHz === piece.rateHz) {
      const first = at < 0 ? other : piece;
      const second = at < 0 ? piece : other;
      const error = (second.startS - first.startS) * piece.rateHz - first.count;
      if (Math.abs(error) < 0.5) {
        at = at < 0 ? other.count + at : at - piece.count;
        piece = other;
      }
    }
    const kept = Math.max(0, Math.min(piece.count - 1, at));
    return piece.frames.subarray(kept * piece.width, (kept + 1) * piece.width);
  }

  /**
   * The keys around `timeS`: `{keys, now}`, `now` an index or -1 at rest.
   *
   * The present key is the one that the hand shows, which runs ahead of the sound: by the clock of
   * the voice's hand, and by `hand`, the key that the drawn hand is nearest to, if it is told.
   * @param {{shape: number, placement: string} | null} [hand]
   * @param {number} timeS @param {number} before @param {number} after
   */
  keysAround(timeS, before, after, hand = null) {
    const near = this.keys.filter((key) => Math.abs(key.start - timeS) < NEAR_S);
    const { next, gone } = this.byTheClock(near, timeS, hand);
    const present = gone ? next : next - 1;
    const low = Math.max(0, present - before);
    const keys = near.slice(low, present + after + 1).filter((key) => Math.abs(key.start - timeS) < 3);
    return { keys, now: gone ? -1 : keys.indexOf(near[present]) };
  }

  /**
   * How many of the keys have been shown at `timeS`, and whether the hand has left the last one.
   * @param {Key[]} near @param {number} timeS @param {HandKey|null} hand
   */
  byTheClock(near, timeS, hand) {
    const strokes = strokesTo(near, this.movement);
    const from = strokes.map((stroke, i) => shownFrom(stroke, strokes[i - 1]));
    let next = from.findIndex((startS) => startS > timeS);
    if (next < 0) next = near.length;
    /** @param {number} i */
    const shows = (i) => hand && near[i] && near[i].shape === hand.shape && near[i].placement === hand.placement;
    if (!shows(next - 1)) {
      if (shows(next) && from[next] - timeS < SLACK_S) next += 1;
      else if (shows(next - 2) && timeS - from[next - 1] < SLACK_S) next -= 1;
    }
    const shown = near[next - 1];
    const following = near[next];
    const rests = !following || following.start - shown?.end >= this.movement.rest_gap_s;
    const gone = !shown || (rests && !shows(next - 1) && timeS > shownUntil(shown, strokes[next - 1], this.movement));
    return { next, gone };
  }
}

/**
 * Catmull-Rom interpolation between rows b and c at x in 0..1.
 * @param {Numbers} a @param {Numbers} b @param {Numbers} c @param {Numbers} d @param {number} x
 * @param {Float64Array} out
 */
function cubic(a, b, c, d, x, out) {
  const x2 = x * x;
  const x3 = x2 * x;
  const wa = 0.5 * (-x3 + 2 * x2 - x);
  const wb = 0.5 * (3 * x3 - 5 * x2 + 2);
  const wc = 0.5 * (-3 * x3 + 4 * x2 + x);
  const wd = 0.5 * (x3 - x2);
  for (let i = 0; i < out.length; i++) out[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i];
}
return { HOLD_S, FADE_S, Timeline };
})();

const $cuer = (() => {
/**
 * The cuer over the programme's clock: motion that was received, sampled and drawn on two canvases.
 *
 * The television's page and `<cuecast-player>` show her by this class; each adds its own controls.
 */

const { AvatarView, parseAvatar } = $avatar;
const { HandReader } = $hand;
const { PointLights } = $points;
const { Timeline } = $timeline;

/** Radius of a point in hundredths of the picture's height, at the usual size. */
const DOT = 0.62;

class Cuer {
  /**
   * `arrays`: of the avatar, or null without one; `canvases`: {points, avatar}.
   * @param {Model} model @param {Arrays|null} arrays
   * @param {{points: HTMLCanvasElement, avatar: HTMLCanvasElement}} canvases
   */
  constructor(model, arrays, canvases) {
    this.model = model;
    this.canvases = canvases;
    this.timeline = new Timeline(model.movement);
    this.reader = new HandReader(model);
    this.points = new PointLights(canvases.points, model);
    this.avatar = arrays && buildAvatar(canvases.avatar, model, arrays);
    this.look = "avatar.bin";
    this.dressed = Promise.resolve();
    this.params = new Float64Array(model.layout.length);
    this.markers = new Float64Array(3 * model.markers.length);
    this.visibility = 0;
    this.scene = "";
    /** @type {PointLights | AvatarView} */
    this.view = this.points;
    this.choose("avatar");
  }

  /**
   * Give the avatar one of the voice's looks, fetched from `base`; one that is unknown is the first.
   * `address`: of another avatar's document, which replaces them all.
   * @param {string} look @param {string} base @param {string} [address]
   */
  dress(look, base, address = "") {
    const later = this.model.looks.slice(1).includes(look);
    const wanted = address || (later ? `avatar-${look}.bin` : "avatar.bin");
    if (this.avatar && wanted !== this.look) this.dressed = this.change(wanted, base);
    return this.dressed;
  }

  /** @param {string} wanted @param {string} base */
  async change(wanted, base) {
    this.look = wanted;
    const answer = await fetch(new URL(wanted, base));
    if (!answer.ok) throw new Error(`${wanted}: ${answer.status}`);
    const arrays = parseAvatar(await answer.arrayBuffer());
    if (String.fromCharCode(...arrays.voice) !== this.model.identity) throw new Error(`${wanted}: made for another voice`);
    if (this.look !== wanted) return;
    this.avatar?.wear(arrays);
    this.forget();
  }

  /** Draw her as `style` from now on: `avatar`, if there is one, or `points`. @param {string} style */
  choose(style) {
    this.view = style === "avatar" && this.avatar ? this.avatar : this.points;
    this.canvases.avatar.hidden = this.view !== this.avatar;
    this.canvases.points.hidden = this.view !== this.points;
    this.forget();
  }

  /** Draw again at the next refresh, even if nothing moved. */
  forget() {
    this.scene = "";
  }

  /**
   * Show her as she is at `timeS`; returns how visible she is, 0 to 1.
   *
   * `look`: {opacity, dot in percent, mirror, handOnly, contrast}. Who stands still is not drawn again.
   * @param {number} timeS @param {LookChoice} look
   */
  show(timeS, { opacity, dot, mirror, handOnly, contrast }) {
    this.visibility = this.timeline.sample(timeS, this.params);
    if (this.visibility > 0) this.model.reconstruct(this.params, this.markers);
    const look = { alpha: this.visibility * opacity / 100, mirror, handOnly, contrast, dot: DOT * dot / 100 };
    const { clientWidth, clientHeight, id } = this.view.canvas;
    const size = [clientWidth, clientHeight, window.devicePixelRatio];
    const scene = [id, timeS, ...size, ...Object.values(look), ...this.params].join();
    if (scene !== this.scene) {
      this.scene = scene;
      if (this.avatar && this.view === this.avatar) this.avatar.draw(timeS, look, (at, out) => this.timeline.sample(at, out));
      else this.points.draw(this.markers, look);
    }
    return this.visibility;
  }

  /** The keys around `timeS`, `before` and `after` the one that the hand shows. @param {number} timeS @param {number} before @param {number} after */
  keysAround(timeS, before, after) {
    const hand = this.visibility > 0 ? this.reader.read(this.markers) : null;
    return this.timeline.keysAround(timeS, before, after, hand);
  }
}

/**
 * The avatar's view, or null where the browser has no WebGL: points are enough.
 * @param {HTMLCanvasElement} canvas @param {Model} model @param {Arrays} arrays
 */
function buildAvatar(canvas, model, arrays) {
  try {
    return new AvatarView(canvas, model, arrays);
  } catch (error) {
    console.warn(`cuecast: no avatar: ${error.message}`);
    return null;
  }
}
return { Cuer };
})();

const $layout = (() => {
/**
 * Where everything stands on a screen: rectangles {left, top, width, height} in CSS pixels.
 *
 * Beside the programme the cuer has a share of the screen's width, below it on an upright screen
 * all of the width; over the programme she has a share of its height. Nothing lies on her: the line
 * of keys, captions, controls and settings go where she is not.
 */

/** Share of the width that she has beside the programme, and of its height over it. @type {Record<string, number>} */
const BESIDE = { small: 1 / 6, medium: 1 / 4, large: 1 / 3 };
/** @type {Record<string, number>} */
const OVER = { small: 0.36, medium: 0.5, large: 0.72 };
const MARGIN = 0.025;
/** Share of the width that the programme keeps where the cuer has the screen. */
const THUMBNAIL = 0.25;
/** Least and usual most size of the keys' letters: below it the names of placements do not fit. */
const LETTERS = [19, 34];
/** Width and height of a key in sizes of its letters, with its gap. */
const KEY_EM = [3.7, 2.6];
const CAPTION_LINES = 2.9;

/** @param {number} least @param {number} value @param {number} most */
const clamp = (least, value, most) => Math.max(least, Math.min(value, most));
/** @param {number} left @param {number} top @param {number} width @param {number} height */
const box = (left, top, width, height) => ({ left, top, width, height });
/** @param {Box} a @param {Box} b */
const meets = (a, b) => a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;

/** The largest rectangle of `ratio` in the middle of `area`. @param {Box} area @param {number} ratio */
function fitted(area, ratio) {
  const width = Math.min(area.width, area.height * ratio);
  const height = width / ratio;
  return box(area.left + (area.width - width) / 2, area.top + (area.height - height) / 2, width, height);
}

/** The largest of the four rectangles around `cuer` within `area`. @param {Box} area @param {Box} cuer */
function freeOf(area, cuer) {
  const right = area.left + area.width;
  const bottom = area.top + area.height;
  const around = [
    box(area.left, area.top, cuer.left - area.left, area.height),
    box(cuer.left + cuer.width, area.top, right - cuer.left - cuer.width, area.height),
    box(area.left, area.top, area.width, cuer.top - area.top),
    box(area.left, cuer.top + cuer.height, area.width, bottom - cuer.top - cuer.height),
  ];
  /** @param {Box} box */
  const worth = ({ width, height }) => Math.min(width, 480) * Math.min(height, 640);
  return around.reduce((best, one) => (worth(one) > worth(best) ? one : best));
}

/** Letters of the keys and how many keys stand on each side of the present one, in `width`. @param {Size} screen @param {number} width */
function keyLine(screen, width) {
  const vmin = Math.min(screen.width, screen.height);
  const size = clamp(LETTERS[0], 0.031 * vmin, LETTERS[1]);
  const around = width >= 5 * KEY_EM[0] * LETTERS[0] ? 2 : 1;
  return { around, size: clamp(11, width / ((2 * around + 1) * KEY_EM[0]), size) };
}

/**
 * The layout of a screen.
 *
 * `screen`: {width, height}; `picture`: the programme's rectangle where the page placed it itself,
 * else null; `ratio` of the programme, 0 without a picture; `aspect` of the cuer; `choice`:
 * {layout, size, place, left, top, width (percent), keys, captions (letters' size in percent of
 * the screen's smaller side, 0 without)}.
 * @param {Size} screen @param {Box|null} picture @param {number} ratio @param {number} aspect
 * @param {LayoutChoice} choice
 */
function layoutOf(screen, picture, ratio, aspect, choice) {
  const area = box(0, 0, screen.width, screen.height);
  /** @type {Record<string, (area: Box, choice: LayoutChoice, aspect: number, picture: Box | null, ratio: number) => Omit<Layout, "kind" | "panel">>} */
  const makers = { alone, whole, below, beside, over };
  const isUpright = screen.height > 1.15 * screen.width;
  let kind = choice.layout === "beside" ? (isUpright ? "below" : "beside") : "over";
  if (choice.size === "whole") kind = "whole";
  if (!ratio) kind = "alone";
  const made = makers[kind](area, choice, aspect, picture, ratio);
  return { kind, ...made, panel: freeOf(area, kind === "alone" || kind === "whole" ? box(area.width * 0.5, 0, area.width * 0.5, area.height) : made.cuer) };
}

/** @param {Box} area @param {LayoutChoice} choice @param {number} width */
function bandOf(area, choice, width) {
  const line = keyLine(area, width);
  return { ...line, height: choice.keys ? KEY_EM[1] * line.size : 0 };
}

/** @param {Box} area @param {LayoutChoice} choice */
const letters = (area, choice) => choice.captions / 100 * Math.min(area.width, area.height);
/** @param {Box} area @param {LayoutChoice} choice */
const captionsOf = (area, choice) => Math.max(choice.captions && 15, letters(area, choice)) * CAPTION_LINES;

/** The cuer in a column or row with her keys under her. @param {Box} space @param {number} aspect @param {KeyBand} band */
function standing(space, aspect, band) {
  const cuer = fitted(box(space.left, space.top, space.width, space.height - band.height), aspect);
  cuer.top = space.top + (space.height - band.height - cuer.height) / 2;
  const keys = { ...band, ...box(space.left, cuer.top + cuer.height, space.width, band.height) };
  return { cuer, keys };
}

/** A programme without picture leaves the screen to her. @param {Box} area @param {LayoutChoice} choice @param {number} aspect */
function alone(area, choice, aspect) {
  const text = captionsOf(area, choice);
  const space = box(0, 0, area.width, area.height - text);
  const captions = box(0, space.height, area.width, text);
  return { ...standing(space, aspect, bandOf(area, choice, area.width)), programme: area, captions, bar: area };
}

/**
 * She has the screen, the programme a corner of it.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} picture @param {number} ratio
 */
function whole(area, choice, aspect, picture, ratio) {
  const text = captionsOf(area, choice);
  const space = box(0, 0, area.width, area.height - text);
  const stood = standing(space, aspect, bandOf(area, choice, area.width));
  const captions = box(0, space.height, area.width, text);
  if (picture) return { ...standing(picture, aspect, bandOf(area, choice, picture.width)), programme: picture, captions, bar: area };
  const side = Math.max((area.width - stood.cuer.width) / 2 - 16, THUMBNAIL * area.width, area.height > area.width ? 0.5 * area.width : 0);
  const width = Math.min(side, 0.5 * area.width);
  const margin = MARGIN * area.height;
  const left = choice.place.endsWith("left") ? area.width - margin - width : margin;
  return { ...stood, programme: box(left, margin, width, width / ratio), captions, bar: area };
}

/**
 * Upright screens: the programme above, captions, the cuer as wide as the screen, her keys.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} _picture
 * @param {number} ratio
 */
function below(area, choice, aspect, _picture, ratio) {
  const text = captionsOf(area, choice);
  const height = Math.min(area.width / ratio, 0.4 * area.height);
  const programme = fitted(box(0, 0, area.width, height), ratio);
  const space = box(0, height + text, area.width, area.height - height - text);
  const row = choice.size === "large" ? space : box(space.left, space.top, space.width, space.height * (choice.size === "medium" ? 0.8 : 0.6));
  const captions = box(0, height, area.width, text);
  return { ...standing(row, aspect, bandOf(area, choice, area.width)), programme, captions, bar: box(0, 0, area.width, height) };
}

/**
 * She has a column of the screen; the programme shrinks to the rest, captions under it.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} _picture
 * @param {number} ratio
 */
function beside(area, choice, aspect, _picture, ratio) {
  const width = area.width * BESIDE[choice.size];
  const isLeft = choice.place.endsWith("left");
  const column = box(isLeft ? 0 : area.width - width, 0, width, area.height);
  const rest = box(isLeft ? width : 0, 0, area.width - width, area.height);
  const text = captionsOf(area, choice);
  const height = Math.min(rest.width / ratio, area.height);
  const programme = fitted(box(rest.left, Math.max(0, (area.height - height - text) / 2), rest.width, height), ratio);
  const captions = box(rest.left, Math.min(programme.top + height, area.height - text), rest.width, text);
  return { ...standing(column, aspect, bandOf(area, choice, width)), programme, captions, bar: rest };
}

/**
 * She stands over the programme, in a corner or where the viewer put her.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} picture @param {number} ratio
 */
function over(area, choice, aspect, picture, ratio) {
  const programme = picture || fitted(area, ratio);
  const cuer = choice.place === "free" ? placed(programme, choice, aspect) : cornered(programme, choice, aspect);
  const { left, top, width, height } = programme;
  const right = left + width - cuer.left - cuer.width;
  const text = captionsOf(area, choice);
  const line = bandOf(area, choice, Math.max(cuer.left - left, right, 0.5 * width));
  const lift = 0.03 * height + text;
  const keys = keysClear(programme, cuer, line, right, lift);
  const captions = box(left, top + 0.985 * height - text, width, text);
  if (meets(captions, cuer)) [captions.left, captions.width] = freeSpan(programme, cuer);
  return { cuer, keys, programme, captions, bar: area };
}

/**
 * The line of keys in the first row that she leaves free; without one, smaller beside her.
 * @param {Box} programme @param {Box} cuer @param {KeyBand} line @param {number} right @param {number} lift
 */
function keysClear({ left, top, width, height }, cuer, line, right, lift) {
  /** @param {KeyLine} line */
  const needs = ({ around, size }) => (2 * around + 1) * KEY_EM[0] * size;
  const low = top + height - lift - line.height;
  /** @type {[number, number, number][]} */
  const spans = [[left, low, width], [left, low, cuer.left - left], [cuer.left + cuer.width, low, right], [left, top, width]];
  /** @param {[number, number, number]} span @param {KeyBand} one */
  const within = ([x, y, w], one) => ({ ...one, ...box(x + (w - needs(one)) / 2, y, needs(one), line.height) });
  const free = spans.find((span) => span[2] >= needs(line) && !meets(within(span, line), cuer));
  if (free) return within(free, line);
  const side = spans[1][2] > right ? spans[1] : spans[2];
  const least = { ...line, around: 1 };
  return within(side, { ...least, size: line.size * Math.min(1, side[2] / needs(least)) });
}

/** The wider part of the programme's width that she leaves: left edge and width. @param {Box} programme @param {Box} cuer */
function freeSpan({ left, width }, cuer) {
  const before = cuer.left - left;
  const after = left + width - cuer.left - cuer.width;
  return before >= after ? [left, before] : [cuer.left + cuer.width, after];
}

/** @param {Box} programme @param {LayoutChoice} choice @param {number} aspect */
function cornered(programme, { size, place }, aspect) {
  const { left, top, width, height } = programme;
  const high = Math.min(height * OVER[size], width / aspect);
  const margin = MARGIN * height;
  const [vertical, horizontal] = place.split("-");
  const x = horizontal === "left" ? left + margin : left + width - margin - high * aspect;
  return box(x, vertical === "top" ? top + margin : top + height - margin - high, high * aspect, high);
}

/** @param {Box} programme @param {LayoutChoice} choice @param {number} aspect */
function placed(programme, { left, top, width }, aspect) {
  const wide = Math.min(programme.width * width / 100, programme.height * aspect);
  const high = wide / aspect;
  return box(programme.left + left / 100 * (programme.width - wide), programme.top + top / 100 * (programme.height - high), wide, high);
}
return { layoutOf };
})();

const $stage = (() => {
/** The stage: everything at its place, the line of keys, the state of reception. */

const { PLACEMENT_NUMBER } = $keys;
const { layoutOf } = $layout;

const SAID_MS = 1400;

class Stage {
  /**
   * `document`: a document or shadow tree with the elements of `index.html`; some may be missing.
   * @param {DocumentOrShadowRoot & NonElementParentNode} document
   */
  constructor(document) {
    /** @param {string} id */
    const find = (id) => /** @type {any} */ (document.getElementById(id));
    this.root = find("stage");
    this.programme = find("programme");
    this.video = this.programme;
    this.inset = find("inset");
    this.bar = find("bar");
    this.panel = find("panel");
    this.captions = find("captions");
    this.keysLine = find("keys");
    this.status = find("status");
    this.statusText = find("status-text");
    this.statusMore = find("status-more");
    this.toast = find("toast");
    this.around = 2;
    this.shownKeys = "";
    /** @type {any} The last `Layout`, there once the stage was arranged. */
    this.layout = null;
  }

  /** Where a page put the programme inside the stage, letterboxed; null where the stage places it itself. */
  picture() {
    const { videoWidth, videoHeight } = this.video;
    if (this.programme || !videoWidth) return null;
    const stage = this.root.getBoundingClientRect();
    const { left, top, width, height } = this.video.getBoundingClientRect();
    const ratio = videoWidth / videoHeight;
    const shown = Math.min(width, height * ratio);
    return {
      left: left - stage.left + (width - shown) / 2,
      top: top - stage.top + (height - shown / ratio) / 2,
      width: shown,
      height: shown / ratio,
    };
  }

  /**
   * Put everything in its place; `choice` as `layoutOf` takes it, with `contrast` and `opacity`.
   * @param {StageChoice} choice @param {number} aspect
   */
  arrange(choice, aspect) {
    const { videoWidth, videoHeight, readyState } = this.video;
    const screen = { width: this.root.clientWidth, height: this.root.clientHeight };
    const ratio = videoWidth ? videoWidth / videoHeight : readyState > 0 ? 0 : 16 / 9;
    const layout = layoutOf(screen, this.picture(), ratio, aspect, choice);
    this.layout = layout;
    this.root.dataset.kind = layout.kind;
    if (this.programme) lay(this.programme, layout.programme);
    lay(this.inset, layout.cuer);
    this.inset.dataset.contrast = choice.contrast;
    this.inset.dataset.movable = Boolean(this.programme) && layout.kind === "over";
    this.inset.style.setProperty("--backdrop", 0.82 * choice.opacity / 100);
    lay(this.keysLine, layout.keys);
    this.keysLine.style.fontSize = `${layout.keys.size}px`;
    this.around = layout.keys.around;
    this.keysLine.hidden = !choice.keys;
    this.arrangeText(choice, layout);
    this.inset.hidden = false;
  }

  /** @param {StageChoice} choice @param {Layout} layout */
  arrangeText({ captions, ground, keys: shown }, { captions: band, keys, programme, bar, panel, kind }) {
    // The word on reception takes the picture's upper left corner, 176 by 40 pixels, or stands below the keys.
    const beside = keys.top > programme.top + 40 || keys.left > programme.left + 176;
    const top = shown && !beside ? keys.top + keys.height : programme.top;
    Object.assign(this.status.style, { left: `${programme.left + 8}px`, top: `${top + 8}px`, maxWidth: `${programme.width - 16}px` });
    if (this.captions) {
      lay(this.captions, band);
      this.captions.hidden = !captions;
      this.captions.dataset.ground = ground;
      this.captions.style.fontSize = `${band.height / 2.9}px`;
    }
    if (this.panel) {
      Object.assign(this.panel.style, {
        left: `${panel.left + 8}px`, top: `${panel.top + 8}px`,
        width: `${Math.min(panel.width - 16, 608)}px`, maxHeight: `${panel.height - 16}px`,
      });
    }
    if (!this.programme) return;
    Object.assign(this.bar.style, { left: `${bar.left}px`, width: `${bar.width}px`, top: "auto", bottom: "0" });
    if (kind === "below") Object.assign(this.bar.style, { bottom: `${this.root.clientHeight - bar.height}px` });
    this.clearBar();
  }

  /** Tell the style how far what stands in the bar's way has to rise while the bar is shown. */
  clearBar() {
    const bar = { left: this.bar.offsetLeft, top: this.bar.offsetTop, width: this.bar.offsetWidth, height: this.bar.offsetHeight };
    /** @param {Box} box */
    const rise = ({ left, top, width, height }) => {
      const beside = left >= bar.left + bar.width - 1 || left + width <= bar.left + 1 || this.layout.kind === "below";
      return beside ? 0 : Math.max(0, Math.min(top + height - bar.top, top));
    };
    const { cuer, keys, captions, kind } = this.layout;
    const text = Math.max(rise(keys), rise(captions));
    /** @param {HTMLElement|null} part @param {number} pixels */
    const raise = (part, pixels) => part?.style.setProperty("--lift", `${-pixels}px`);
    raise(this.inset, rise(cuer));
    raise(this.keysLine, kind === "over" ? text : rise(keys));
    raise(this.captions, text);
  }

  /**
   * Show the keys around the present one: phones above, placement and shape as the paper prints them.
   * @param {{keys: Key[], now: number}} shown @param {Words} words
   */
  showKeys({ keys, now }, words) {
    const line = keys.map((key) => `${key.start}`).join() + now + words.rest;
    if (line === this.shownKeys) return;
    this.shownKeys = line;
    this.keysLine.textContent = "";
    keys.forEach((key, index) => {
      const item = document.createElement("li");
      const phones = document.createElement("b");
      const code = document.createElement("small");
      phones.textContent = key.phones.join("") || "·";
      code.textContent = `${PLACEMENT_NUMBER[key.placement]}${key.shape} ${words[key.placement]}`;
      if (index === now) {
        item.className = "now";
        item.setAttribute("aria-current", "true");
      }
      item.append(phones, code);
      this.keysLine.append(item);
    });
  }

  /**
   * `whose`: what is known of who speaks, `{status, of}`, or null where nobody asked; `more` changes too often to be read aloud.
   * @param {string} state @param {Words} words @param {Whose|null} whose @param {string} [more]
   */
  showStatus(state, words, whose, more = "") {
    this.status.dataset.state = state;
    this.status.dataset.whose = whose ? whose.status : "";
    let text = words[state];
    if (whose) text += ` · ${words[whose.status]}${whose.status === "verified" ? ` (${whose.of})` : ""}`;
    const ageS = whose?.age_s ?? 0;
    if (Math.abs(ageS) >= 1) text += ` · ${Math.round(ageS)} s`;
    if (this.statusText.textContent !== text) this.statusText.textContent = text;
    if (this.statusMore && this.statusMore.textContent !== more) this.statusMore.textContent = more;
  }

  /** Without a cuer there is no box: the programme is seen whole. @param {boolean} present */
  showCuer(present) {
    this.inset.classList.toggle("empty", !present);
  }

  /** A word that passes: what a key press did. @param {string} text */
  say(text) {
    this.toast.textContent = text;
    this.toast.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = setTimeout(() => { this.toast.hidden = true; }, SAID_MS);
  }
}

/** @param {HTMLElement} element @param {Box} box */
function lay(element, { left, top, width, height }) {
  Object.assign(element.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` });
}
return { Stage };
})();

const $texts = (() => {
/** Every word on the page, in French and English. */

/** @type {Record<string, Words>} */
const TEXTS = {
  fr: {
    cuer: "Codeuse en langue française parlée complétée", keysLine: "Clés codées", controls: "Commandes",
    play: "Lecture", pause: "Pause", stepBack: "Image précédente", stepForward: "Image suivante",
    seek: "Position dans le programme", speed: "Vitesse", style: "Style de la codeuse", handOnly: "Main seule",
    settings: "Réglages", full: "Plein écran", keyboard: "Clavier et télécommande",
    appearance: "Apparence", woman: "Femme", man: "Homme", elder: "Femme âgée",
    points: "Points", avatar: "Avatar", place: "Emplacement", size: "Taille", mirror: "Gaucher (miroir)",
    opacity: "Opacité", contrast: "Contraste", keys: "Afficher les clés", language: "Langue", dot: "Taille des points",
    layout: "Disposition", beside: "À côté du programme", over: "Sur le programme", free: "Libre (glisser)",
    left: "De gauche à droite", top: "De haut en bas", width: "Largeur", delay: "Retard de la codeuse",
    captions: "Sous-titres", ground: "Fond des sous-titres", shade: "Voilé", box: "Noir", none: "Sans",
    absent: "Pas de codeuse dans ce programme", searched: "recherchée sur",
    "bottom-right": "En bas à droite", "bottom-left": "En bas à gauche", "top-right": "En haut à droite",
    "top-left": "En haut à gauche", small: "Petite", medium: "Moyenne", large: "Grande", whole: "Plein écran, programme en vignette",
    panel: "Fond sombre", outline: "Contour, sans fond", strong: "Fort contraste",
    connecting: "Connexion…", searching: "Recherche de la codeuse…", locked: "Codeuse reçue",
    degraded: "Réception affaiblie", lost: "Signal perdu", ended: "Fin du programme",
    offline: "Récepteur injoignable", crowded: "Trop de pages regardent déjà",
    verified: "authentique", unknown: "origine inconnue", forged: "falsifiée", unsigned: "non signée", failed: "Lecture impossible", awaiting: "En attente de la codeuse",
    recoded: "Image recodée pour ce navigateur", unseen: "Image illisible, son et codeuse seuls",
    "help-play": "lecture ou pause", "help-seek": "reculer, avancer de 5 s", "help-step": "image par image",
    "help-speed": "moins vite, plus vite", "help-style": "points ou avatar", "help-hand": "main seule",
    "help-place": "changer de coin", "help-size": "changer de taille", "help-mirror": "miroir", "help-focus": "aller aux commandes",
    "help-layout": "à côté ou dessus", "help-captions": "sous-titres",
    "help-keys": "clés", "help-full": "plein écran", "help-language": "English", "help-settings": "ces réglages",
    green: "vert", red: "rouge", yellow: "jaune", blue: "bleu",
    rest: "repos", side: "côté", mouth: "bouche", chin: "menton", cheek: "pommette", throat: "gorge",
  },
  en: {
    cuer: "Cuer in French Cued Speech", keysLine: "Keys being cued", controls: "Controls",
    play: "Play", pause: "Pause", stepBack: "Previous picture", stepForward: "Next picture",
    seek: "Position in the programme", speed: "Speed", style: "Style of the cuer", handOnly: "Hand only",
    settings: "Settings", full: "Full screen", keyboard: "Keyboard and remote control",
    appearance: "Appearance", woman: "Woman", man: "Man", elder: "Elderly woman",
    points: "Points", avatar: "Avatar", place: "Place", size: "Size", mirror: "Left-handed (mirror)",
    opacity: "Opacity", contrast: "Contrast", keys: "Show the keys", language: "Language", dot: "Size of the points",
    layout: "Layout", beside: "Beside the programme", over: "Over the programme", free: "Free (drag her)",
    left: "From left to right", top: "From top to bottom", width: "Width", delay: "Delay of the cuer",
    captions: "Captions", ground: "Ground of captions", shade: "Shaded", box: "Black", none: "None",
    absent: "No cuer in this programme", searched: "searched for",
    "bottom-right": "Bottom right", "bottom-left": "Bottom left", "top-right": "Top right",
    "top-left": "Top left", small: "Small", medium: "Medium", large: "Large", whole: "Full screen, programme small",
    panel: "Dark panel", outline: "Outline, no panel", strong: "Strong contrast",
    connecting: "Connecting…", searching: "Searching for the cuer…", locked: "Cuer received",
    degraded: "Weak reception", lost: "Signal lost", ended: "End of the programme",
    offline: "Receiver unreachable", crowded: "Too many pages are watching",
    verified: "authentic", unknown: "origin unknown", forged: "forged", unsigned: "not signed", failed: "Cannot play the programme", awaiting: "Waiting for the cuer",
    recoded: "Picture recoded for this browser", unseen: "Picture cannot be shown, sound and cuer only",
    "help-play": "play or pause", "help-seek": "5 s back, forward", "help-step": "picture by picture",
    "help-speed": "slower, faster", "help-style": "points or avatar", "help-hand": "hand only",
    "help-place": "next corner", "help-size": "next size", "help-mirror": "mirror", "help-focus": "go to the controls",
    "help-layout": "beside or over", "help-captions": "captions",
    "help-keys": "keys", "help-full": "full screen", "help-language": "français", "help-settings": "these settings",
    green: "green", red: "red", yellow: "yellow", blue: "blue",
    rest: "rest", side: "side", mouth: "mouth", chin: "chin", cheek: "cheek", throat: "throat",
  },
};

/** Name every control in `language`: accessible names, tooltips and headings. @param {HTMLElement} root @param {string} language */
function label(root, language) {
  const words = TEXTS[language];
  root.lang = language;
  for (const element of /** @type {NodeListOf<HTMLElement>} */ (root.querySelectorAll("[data-name]"))) {
    element.setAttribute("aria-label", words[element.dataset.name || ""]);
    if (element.tagName === "BUTTON") element.title = words[element.dataset.name || ""];
  }
  for (const element of /** @type {NodeListOf<HTMLElement>} */ (root.querySelectorAll("[data-text]"))) element.textContent = words[element.dataset.text || ""];
  return words;
}
return { TEXTS, label };
})();

const $hearing = (() => {
/**
 * Hearing of a media element: its sound goes through a worklet to the decoder's worker.
 *
 * The sound is rerouted only where the page may hear it and the audio context runs: otherwise the
 * browser would mute the programme. A reroute cannot be undone, so it is kept per media element.
 */

/** The clock is known from so many readings, or from a few that agree. */
const SETTLED = 15;
const FEW = 5;
const AGREE_S = 0.015;
const KEPT = 240;
/** A pause ends where it began, but for this. */
const SAME_PLACE_S = 0.1;
const GESTURES = ["pointerdown", "keydown"];
const QUIET_DBFS = -120;
const QUIET_S = 4;
const SEARCHED_S = 10;
const WAKE_MS = 3000;

/** Media element to `{context, source}`: a source can be made once. */
const rerouted = new WeakMap();

/** Why the page may not hear `media`: a name of `REASONS`, or "" if it may. @param {HTMLMediaElement|null} media */
function obstacle(media) {
  if (!media) return "no-media";
  if (!isSecureContext) return "insecure";
  if (typeof AudioWorkletNode === "undefined") return "no-worklet";
  if (typeof WebAssembly === "undefined") return "no-module";
  const address = media.currentSrc || media.src;
  if (address && !address.startsWith("data:") && !media.crossOrigin) {
    if (new URL(address, location.href).origin !== location.origin) return "other-origin";
  }
  return "";
}

class Hearing {
  /** @type {any} */
  worker;
  /** @type {any} */
  context;
  /** @type {any} */
  source;
  /** @type {any} */
  node;

  /**
   * `files`: {module, voice, worklet, worker, trust}; `handlers`: heard(message, offsetS), reason(name, text).
   * @param {HTMLMediaElement} media @param {PlayerFiles} files @param {HearingHandlers} handlers
   */
  constructor(media, files, handlers) {
    this.media = media;
    this.files = files;
    this.handlers = handlers;
    this.segment = 0;
    /** @type {number[]} Media time less the audio context's, as read at refreshes. */
    this.offsets = [];
    this.hearing = false;
    this.pausedAtS = null;
    this.readAtS = NaN;
    /** Media time less the receiver's, seconds; a pause does not change it. */
    this.placeS = null;
    /** @type {Promise<void> | null} */
    this.opened = null;
    this.locked = false;
    /** @type {[string, () => void][]} */
    this.listeners = [
      ["playing", () => this.begin()], ["pause", () => this.pause()], ["seeking", () => this.stop()],
      ["seeked", () => this.begin()], ["waiting", () => this.pause()],
      ["ratechange", () => { this.stop(); this.begin(); }], ["volumechange", () => this.checkMuted()], ["emptied", () => this.stop()],
    ];
    for (const [name, listener] of this.listeners) media.addEventListener(name, listener);
    if (!media.paused && media.readyState > 2) this.begin();
  }

  /** Hear from now on, if the page may; goes on where the programme was paused. */
  async begin() {
    const { media, pausedAtS } = this;
    if (media.paused || this.hearing) return;
    if (pausedAtS !== null && Math.abs(media.currentTime - pausedAtS) < SAME_PLACE_S) return this.resume();
    this.stop();
    const reason = obstacle(media);
    if (reason) return this.handlers.reason(reason);
    if (media.playbackRate !== 1) return this.handlers.reason("speed");
    try {
      this.opened ??= this.open();
      await this.opened;
    } catch (error) {
      this.opened = null;
      if (error.reason === "asleep") this.awaitGesture();
      return this.handlers.reason(error.reason || "failed", error.message);
    }
    if (media.paused || media.seeking || media.playbackRate !== 1) return;
    this.segment += 1;
    this.offsets = [];
    this.placeS = null;
    this.locked = false;
    this.hearing = true;
    this.handlers.reason(this.checkMuted() ? "muted" : "");
    this.worker.postMessage({ type: "hear", segment: this.segment, fromS: this.context.currentTime, live: media.duration === Infinity });
  }

  /** The programme stands still: its sound will go on from here. */
  pause() {
    if (!this.hearing) return;
    this.pausedAtS = this.media.currentTime;
    this.worker.postMessage({ type: "pause" });
    this.hearing = false;
  }

  resume() {
    this.pausedAtS = null;
    this.offsets = [];
    this.hearing = true;
    this.worker.postMessage({ type: "resume" });
  }

  stop() {
    if (this.hearing || this.pausedAtS !== null) this.worker.postMessage({ type: "stop" });
    this.hearing = false;
    this.pausedAtS = null;
  }

  /** Try again at the viewer's next click or key press anywhere in the page. */
  awaitGesture() {
    const again = () => {
      for (const name of GESTURES) document.removeEventListener(name, again, true);
      this.begin();
    };
    for (const name of GESTURES) document.addEventListener(name, again, true);
  }

  checkMuted() {
    const muted = this.media.muted || this.media.volume === 0;
    if (this.hearing && muted) this.handlers.reason("muted");
    return muted;
  }

  /** Reroute the sound and start the worker; rejects with `reason`, having changed nothing. */
  async open() {
    const known = rerouted.get(this.media);
    const context = known ? known.context : new AudioContext();
    await Promise.race([context.resume(), new Promise((done) => setTimeout(done, WAKE_MS))]);
    if (context.state !== "running") {
      if (!known) context.close();
      throw because("asleep");
    }
    const { module, voice, worklet, worker, trust } = this.files;
    try {
      if (!known) await context.audioWorklet.addModule(worklet);
      this.worker = new Worker(worker, { type: "module" });
    } catch (error) {
      if (!known) context.close();
      throw because("no-files", error.message);
    }
    const { port1, port2 } = new MessageChannel();
    this.worker.onmessage = (/** @type {MessageEvent} */ { data }) => this.receive(data);
    this.worker.onerror = (/** @type {ErrorEvent} */ event) => this.handlers.reason("failed", event.message);
    this.worker.postMessage({ type: "open", module, voice, rateHz: context.sampleRate, channels: 2, port: port1, ...trust }, [port1]);
    const node = new AudioWorkletNode(context, "cuecast-hearing", { numberOfOutputs: 0 });
    node.port.postMessage(port2, [port2]);
    const source = known ? known.source : context.createMediaElementSource(this.media);
    source.connect(node);
    if (!known) source.connect(context.destination);
    rerouted.set(this.media, { context, source });
    Object.assign(this, { context, source, node });
  }

  /** @param {any} message */
  receive(message) {
    if (message.type === "failed") return this.handlers.reason("failed", message.text);
    if (message.segment !== this.segment) return;
    this.tick();
    if (this.settled()) this.placeS = this.offset() + message.lagS;
    if (this.placeS === null) return this.keep(message);
    this.judge(message);
    for (const kept of this.kept.splice(0)) this.handlers.heard(kept, this.placeS);
    this.handlers.heard(message, this.placeS);
  }

  /** Whether media time is known against the context's. */
  settled() {
    const { offsets } = this;
    const last = offsets.slice(-FEW);
    return offsets.length >= SETTLED || (last.length === FEW && Math.max(...last) - Math.min(...last) < AGREE_S);
  }

  /** Hold back what came before the clock was known. @param {any} message */
  keep(message) {
    if (this.keptOf !== this.segment) this.kept.length = 0;
    this.keptOf = this.segment;
    this.kept.push(message);
  }

  /** @type {any[]} Messages that wait for the clock. */
  kept = [];
  keptOf = -1;

  /** Tell why nothing is received although the programme plays. @param {any} message */
  judge({ events, diagnosis }) {
    if (events.some((/** @type {{kind: string}} */ event) => event.kind === "unreadable")) this.handlers.reason("other-voice");
    if (diagnosis.superframes && !this.locked) {
      this.locked = true;
      this.handlers.reason("");
    }
    if (this.locked || this.checkMuted()) return;
    if (Math.max(...diagnosis.levelsDbfs) < QUIET_DBFS) {
      if (diagnosis.heardS > QUIET_S) this.handlers.reason("silence");
    } else if (diagnosis.heardS > SEARCHED_S) this.handlers.reason("no-mark");
  }

  /** Read media time against the context's time; call at each refresh. */
  tick() {
    const { currentTime, seeking, paused } = this.media;
    if (!this.hearing || seeking || paused || currentTime === this.readAtS) return;
    this.readAtS = currentTime;
    this.offsets.push(currentTime - this.context.currentTime);
    if (this.offsets.length > KEPT) this.offsets.shift();
  }

  /** Media time less the context's time, seconds: the median, as both clocks go in steps. */
  offset() {
    const sorted = [...this.offsets].sort((a, b) => a - b);
    return sorted[sorted.length >> 1];
  }

  close() {
    for (const [name, listener] of this.listeners) this.media.removeEventListener(name, listener);
    this.stop();
    this.worker?.terminate();
    if (this.node) this.source.disconnect(this.node);
  }
}

/** @param {string} reason @param {string} [text] */
function because(reason, text = "") {
  return Object.assign(new Error(text || reason), { reason });
}
return { obstacle, Hearing };
})();

const $reasons = (() => {
/** Why there is no cuer: every reason that a player can give, in the page's languages. */

/** @type {Record<string, Words>} */
const REASONS = {
  "no-media": {
    en: "There is no <video> or <audio> inside the player.",
    fr: "Le lecteur ne contient ni <video> ni <audio>.",
  },
  "other-origin": {
    en: "The programme comes from another site, and a page may not hear such sound. Serve it from the page's own site, or with Access-Control-Allow-Origin and crossorigin=\"anonymous\", or put its .cue file beside it.",
    fr: "Le programme vient d'un autre site : la page n'a pas le droit d'en entendre le son.",
  },
  insecure: {
    en: "The page came without https, and browsers let such a page read sound on localhost only.",
    fr: "La page est venue sans https : le navigateur ne lui laisse lire le son que sur localhost.",
  },
  "no-worklet": {
    en: "This browser has no AudioWorklet.",
    fr: "Ce navigateur n'offre pas AudioWorklet.",
  },
  "no-module": {
    en: "This browser cannot run the receiver (WebAssembly with SIMD).",
    fr: "Ce navigateur ne peut pas exécuter le récepteur (WebAssembly avec SIMD).",
  },
  "no-files": {
    en: "Files of the player are missing: cuecast.wasm, voice.bin and voice.json belong beside its script.",
    fr: "Des fichiers du lecteur manquent à côté de son script.",
  },
  "no-file": {
    en: "The stream file that the player's attribute cue names is missing, damaged or of another voice.",
    fr: "Le fichier .cue que nomme l'attribut cue manque, est abîmé ou d'une autre voix.",
  },
  "no-key": {
    en: "The broadcaster's public file that the player's attribute trust names is missing.",
    fr: "Le fichier public du diffuseur que nomme l'attribut trust manque.",
  },
  asleep: {
    en: "The browser lets the page hear only after a click or a key press.",
    fr: "Le navigateur attend un clic ou une touche avant de laisser la page entendre.",
  },
  muted: {
    en: "The programme is muted: the cuer travels in its sound.",
    fr: "Le son est coupé, et la codeuse voyage dans le son.",
  },
  speed: {
    en: "At another speed than 1 the cuer cannot be heard; cues heard before are still shown.",
    fr: "À une autre vitesse que 1, la codeuse n'est pas reçue ; ce qui fut reçu reste visible.",
  },
  silence: {
    en: "The programme plays, but the page hears silence: it has no sound, or a redirection to another site.",
    fr: "Le programme joue, mais la page n'entend que du silence.",
  },
  "no-mark": {
    en: "There is sound, but no cuer was found in it so far.",
    fr: "Il y a du son, mais aucune codeuse n'y a été trouvée.",
  },
  "other-voice": {
    en: "The programme has a cuer of another voice or of another version of the format.",
    fr: "La codeuse de ce programme est d'une autre voix ou d'une autre version.",
  },
  failed: {
    en: "The receiver failed; the console has its words.",
    fr: "Le récepteur a échoué ; la console dit pourquoi.",
  },
};
return { REASONS };
})();

const $sidecar = (() => {
/**
 * The stream file beside a programme: its cuer without the programme's sound, on the media's clock.
 * It is fetched whole and decoded in the worker some way ahead of the viewer, at any speed.
 */

const AHEAD_S = 30;
const REFILL_S = 15;
const BEFORE_S = 5;
/** As far behind the viewer the page's timeline remembers. */
const KEPT_S = 290;

/**
 * Where the stream file of `media` is: `named`, or the programme's address with `.cue` at its end; "" if nowhere.
 * @param {HTMLMediaElement} media @param {string|null} named
 */
function sidecarAddress(media, named) {
  if (named) return new URL(named, document.baseURI).href;
  const address = media.currentSrc || media.src;
  if (!/^https?:/.test(address)) return "";
  const url = new URL(address);
  url.search = url.hash = "";
  url.pathname = url.pathname.replace(/(\.[^./]*)?$/, ".cue");
  return url.href;
}

class Sidecar {
  /**
   * Fetch and open a stream file; rejects if there is none or it cannot be read.
   * @param {HTMLMediaElement} media @param {string} address @param {PlayerFiles} files
   * @param {HearingHandlers} handlers
   */
  static async open(media, address, files, handlers) {
    if (!address) throw new Error("the programme has no address of its own");
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
    const sidecar = new Sidecar(media, files, handlers);
    try {
      await sidecar.load(await answer.arrayBuffer());
    } catch (error) {
      sidecar.close();
      throw error;
    }
    return sidecar;
  }

  /** @param {HTMLMediaElement} media @param {PlayerFiles} files @param {HearingHandlers} handlers */
  constructor(media, { module, voice, worker }, handlers) {
    this.media = media;
    this.handlers = handlers;
    this.worker = new Worker(worker, { type: "module" });
    this.worker.postMessage({ type: "open", module, voice, rateHz: 48000, channels: 2 });
    /** Known, and asked for, from here to there: seconds of the programme. */
    this.fromS = 0;
    this.untilS = -Infinity;
  }

  /** @param {ArrayBuffer} bytes */
  load(bytes) {
    return new Promise((resolve, reject) => {
      this.worker.onerror = (event) => reject(new Error(event.message));
      this.worker.onmessage = ({ data }) => {
        if (data.type === "failed") reject(new Error(data.text));
        else if (data.type === "opened") resolve(data);
        else this.handlers.heard(data, 0);
      };
      this.worker.postMessage({ type: "file", bytes }, [bytes]);
    });
  }

  /** Have what the viewer needs next decoded; call at each refresh. */
  tick() {
    const { currentTime } = this.media;
    this.fromS = Math.max(this.fromS, currentTime - KEPT_S);
    const anew = currentTime < this.fromS;
    if (!anew && currentTime + REFILL_S < this.untilS) return;
    const gone = anew || currentTime > this.untilS;
    if (gone) this.fromS = Math.max(0, currentTime - BEFORE_S);
    this.untilS = currentTime + AHEAD_S;
    this.worker.postMessage({ type: "read", anew, fromS: this.fromS, untilS: this.untilS });
  }

  close() {
    this.worker.terminate();
  }
}
return { sidecarAddress, Sidecar };
})();

const $style = (() => {
const STYLE = ":host {\n  --ink: #f3f1ec;\n  --soft: #a9aab4;\n  --faint: rgba(255, 255, 255, .12);\n  --ground: #07080b;\n  --glass: rgba(14, 16, 22, .82);\n  --accent: #f5b85b;\n  --good: #6fd39a;\n  --bad: #f0716b;\n  font: 16px/1.4 system-ui, \"Segoe UI\", Roboto, \"DejaVu Sans\", sans-serif;\n  color: var(--ink);\n  color-scheme: dark;\n  background: var(--ground);\n}\n* { box-sizing: border-box; }\n[hidden] { display: none !important; }\nhtml, body { height: 100vh; height: 100dvh; margin: 0; overflow: hidden; }\nbutton, input, select { font: inherit; color: inherit; }\n:focus-visible { outline: 3px solid var(--accent); outline-offset: 2px; }\n\n.unseen { position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; clip-path: inset(50%); }\n.stage { position: relative; width: 100%; height: 100%; background: radial-gradient(120% 90% at 50% 35%, #14161d 0, var(--ground) 75%); }\n.stage.quiet { cursor: none; }\n.programme { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain; transition: left .25s, top .25s, width .25s, height .25s; }\n.stage[data-kind=\"whole\"] .programme { z-index: 1; border-radius: .6vmin; box-shadow: 0 .6vmin 2.4vmin rgba(0, 0, 0, .5); }\n\n.inset { position: absolute; overflow: hidden; border-radius: 1.1vmin; pointer-events: none; transition: left .25s, top .25s, width .25s, height .25s, transform .3s; }\n.stage[data-kind=\"over\"] .inset[data-contrast=\"panel\"] { background: rgba(5, 6, 9, var(--backdrop, .82)); box-shadow: 0 .6vmin 2.4vmin rgba(0, 0, 0, .45), inset 0 0 0 1px rgba(255, 255, 255, .08); }\n.inset[data-contrast=\"strong\"] { background: #000; box-shadow: inset 0 0 0 2px var(--accent); }\n.inset[data-movable=\"true\"] { pointer-events: auto; cursor: move; touch-action: none; transition: transform .3s; }\n.corner { display: none; position: absolute; right: 0; bottom: 0; width: 24px; height: 24px; cursor: nwse-resize; border: solid var(--ink); border-width: 0 3px 3px 0; border-radius: 0 0 1.1vmin 0; opacity: .7; }\n.inset[data-movable=\"true\"]:hover .corner, .stage:not(.quiet) .inset[data-movable=\"true\"] .corner { display: block; }\n.stage:not(.quiet) :is(.inset, .keys, .captions) { transform: translateY(var(--lift, 0)); }\n.layer { position: absolute; inset: 0; width: 100%; height: 100%; }\n.inset.empty { visibility: hidden; }\n\n.status { position: absolute; z-index: 2; top: 8px; left: 8px; margin: 0; padding: .45em .95em; display: flex; flex-wrap: wrap; align-items: center; gap: .1em .6em; border-radius: 1.2em; background: var(--glass); font-size: clamp(12px, 1.9vmin, 20px); transition: opacity .4s; }\n.more:empty { display: none; }\n.more { color: var(--soft); }\n.lamp { width: .7em; height: .7em; border-radius: 50%; background: var(--soft); }\n.status[data-state=\"searching\"] .lamp, .status[data-state=\"awaiting\"] .lamp { background: var(--accent); animation: breathe 1.2s ease-in-out infinite; }\n.status[data-state=\"locked\"] .lamp { background: var(--good); }\n.status[data-state=\"degraded\"] .lamp { background: var(--accent); }\n.status[data-state=\"lost\"] .lamp { background: var(--bad); }\n.quiet .status[data-state=\"locked\"] { opacity: 0; }\n@keyframes breathe { 50% { opacity: .3; } }\n\n.captions { position: absolute; display: flex; flex-direction: column; justify-content: flex-end; padding: 0 .5em .1em; text-align: center; line-height: 1.3; pointer-events: none; transition: transform .3s; }\n.captions p { margin: 0; white-space: pre-line; }\n.captions p > span { padding: .05em .4em; border-radius: .2em; box-decoration-break: clone; -webkit-box-decoration-break: clone; }\n.captions img { max-width: 100%; max-height: 100%; min-height: 0; margin: 0 auto; object-fit: contain; border-radius: .2em; }\n.captions[data-ground=\"shade\"] :is(p > span, img) { background: var(--glass); }\n.captions[data-ground=\"box\"] :is(p > span, img) { background: #000; }\n.captions[data-ground=\"none\"] { text-shadow: 0 0 .15em #000, 0 0 .15em #000, 0 0 .3em #000, .06em .06em .1em #000; }\n.stage:is([data-kind=\"beside\"], [data-kind=\"below\"], [data-kind=\"whole\"]) .captions { justify-content: flex-start; padding-top: .3em; }\n.captions .yellow { color: #ff0; }\n.captions .cyan { color: #0ff; }\n.captions .lime, .captions .green { color: #0f0; }\n.captions .magenta { color: #ff7dff; }\n.captions .red { color: #ff8a80; }\n.captions .blue { color: #9db8ff; }\n\n.keys { position: absolute; margin: 0; padding: 0; display: flex; justify-content: center; align-items: center; gap: .3em; list-style: none; transition: transform .3s; pointer-events: none; }\n.keys li { width: 3.4em; padding: .15em 0 .25em; text-align: center; background: var(--glass); border-radius: .35em; border: 1px solid transparent; color: var(--soft); }\n.keys li b { display: block; font-weight: 600; letter-spacing: .04em; line-height: 1.25; }\n.keys li small { display: block; font-size: max(.45em, 9px); letter-spacing: .02em; white-space: nowrap; line-height: 1.2; }\n.keys li.now { color: #14100a; background: var(--accent); }\n\n.toast { position: absolute; z-index: 3; top: 2.4vmin; right: 2.4vmin; margin: 0; padding: .5em 1em; border-radius: .5em; background: var(--glass); font-size: clamp(13px, 2.2vmin, 24px); }\n\n.bar { position: absolute; z-index: 2; left: 0; bottom: 0; padding: 4vmin 2vmin 1.6vmin; background: linear-gradient(transparent, rgba(5, 6, 9, .88) 55%); transition: opacity .3s, transform .3s; }\n.quiet .bar { opacity: 0; transform: translateY(2vmin); pointer-events: none; }\n.row { display: flex; align-items: center; gap: .6em; margin-top: .5em; font-size: clamp(13px, 2vmin, 22px); }\n.gap { flex: 1; }\n.button { min-width: 2.6em; height: 2.4em; padding: 0 .8em; border: 0; border-radius: .55em; background: var(--faint); cursor: pointer; transition: background .15s; }\n.button:hover { background: rgba(255, 255, 255, .22); }\n.button[aria-pressed=\"true\"] { background: var(--accent); color: #14100a; }\n.button svg { display: block; width: 1.05em; height: 1.05em; margin: auto; fill: currentColor; }\n.wide { min-width: 6em; }\n#play::before { content: \"\u275a\u275a\" / \"\"; margin-right: .4em; }\n#play[data-paused=\"true\"]::before { content: \"\u25b6\" / \"\"; }\n.clock { padding: 0 .5em; color: var(--soft); font-variant-numeric: tabular-nums; }\n.seek { width: 100%; margin: 0; height: 1.2em; accent-color: var(--accent); cursor: pointer; }\n\n.panel { position: absolute; z-index: 4; overflow: auto; padding: 1.1em 1.4em 1.3em; border-radius: .9em; background: #101219; box-shadow: 0 1vmin 5vmin rgba(0, 0, 0, .6), inset 0 0 0 1px rgba(255, 255, 255, .07); font-size: clamp(13px, 1.9vmin, 20px); }\n.panel h2 { margin: .2em 0 .6em; font-size: 1em; font-weight: 600; color: var(--accent); letter-spacing: .02em; }\n.panel h2:not(:first-child) { margin-top: 1.2em; }\n.choices { display: grid; grid-template-columns: 1fr 1.5fr; gap: .55em 1em; align-items: center; }\n.choices label { color: var(--ink); }\n.choices select, .choices input[type=\"range\"] { width: 100%; }\n.choices select { padding: .3em .5em; border: 0; border-radius: .4em; background: #272a34; }\n.choices input[type=\"range\"] { accent-color: var(--accent); }\n.choices input[type=\"checkbox\"] { width: 1.3em; height: 1.3em; accent-color: var(--accent); }\n.help { display: grid; grid-template-columns: auto 1fr auto 1fr; gap: .25em .9em; font-size: .92em; margin: 0; color: var(--soft); }\n.help dt { color: var(--ink); white-space: nowrap; }\n.help dd { margin: 0; }\n@media (max-width: 40em) {\n  .row { flex-wrap: wrap; gap: .35em; }\n  .row .gap { display: none; }\n  .wide { min-width: 5em; }\n  .help { grid-template-columns: auto 1fr; }\n  .toast { top: 30vh; left: 50%; right: auto; transform: translateX(-50%); width: max-content; max-width: 90vw; }\n}\n@media (max-height: 30em) and (orientation: landscape) {\n  .row { gap: .3em; }\n  .button { padding: 0 .5em; min-width: 2.4em; }\n  .wide { min-width: 5em; }\n}\n@media (prefers-reduced-motion: reduce) { * { transition: none !important; animation: none !important; } }\n@media (prefers-contrast: more) { :host { --soft: #d9dae2; --glass: rgba(0, 0, 0, .94); } }\n/* The system's colours: what a ground said before, a border or the system's own mark says now. */\n@media (forced-colors: active) {\n  .button, .status, .toast, .panel, .keys li { border: 2px solid ButtonBorder; }\n  .button[aria-pressed=\"true\"], .keys li.now { forced-color-adjust: none; background: Highlight; color: HighlightText; border-color: HighlightText; outline: 2px solid Highlight; }\n  .captions p > span { forced-color-adjust: none; background: Canvas; color: CanvasText; text-shadow: none; }\n  .captions[data-ground] img { forced-color-adjust: none; background: #000; }\n  .lamp { forced-color-adjust: none; background: CanvasText; }\n  .inset[data-contrast] { background: Canvas; }\n  .button svg { fill: ButtonText; }\n}\n\n:host { display: block; position: relative; }\n:host([hidden]) { display: none; }\n.stage { height: auto; container-type: inline-size; }\n.stage:not(.sound) { background: none; }\n.stage.quiet { cursor: auto; }\n.stage.sound { aspect-ratio: 16 / 9; display: flex; align-items: flex-end; }\n::slotted(video) { display: block; width: 100%; }\n::slotted(audio) { width: 100%; }\n.status { pointer-events: none; max-width: 90%; font-size: clamp(10px, 1.7cqw, 20px); }\n.keys { pointer-events: none; font-size: clamp(10px, 2.3cqw, 34px); }\n.keys li small { white-space: nowrap; }\n";
return { STYLE };
})();

const $element = (() => {
/**
 * `<cuecast-player>`: draws the cuer over the `<video>` or `<audio>` inside it.
 *
 *     <script type="module" src="cuecast-player.js"></script>
 *     <cuecast-player><video src="programme.mp4" controls></video></cuecast-player>
 */

const { parseAvatar } = $avatar;
const { ProgrammeClock } = $clock;
const { Cuer } = $cuer;
const { VoiceModel } = $model;
const { Stage } = $stage;
const { TEXTS } = $texts;
const { Hearing, obstacle } = $hearing;
const { REASONS } = $reasons;
const { Sidecar, sidecarAddress } = $sidecar;
const { STYLE } = $style;

const BODY = `<div id="stage" class="stage quiet" part="stage"><slot></slot>
<div id="inset" class="inset empty" part="inset"><canvas id="points" class="layer" role="img" part="cuer"></canvas>
<canvas id="avatar" class="layer" role="img" part="cuer" hidden></canvas></div>
<p id="status" class="status" part="status"><span class="lamp" aria-hidden="true"></span><span id="status-text" role="status"></span></p>
<ol id="keys" class="keys" part="keys" hidden></ol></div>`;

/** What stands in an attribute, with what holds without it; a flag is there or not. */
const CHOICES = /** @type {Words} */ ({
  look: "avatar", appearance: "woman", place: "bottom-right", size: "medium", contrast: "panel", opacity: "100",
});
/** @type {Words} */
const FLAGS = { keys: "keys", mirror: "mirror", handOnly: "hand-only" };
/** Reasons for which the stream file beside the programme is looked for. */
const DEAF = new Set(["other-origin", "insecure", "no-worklet", "asleep", "muted", "speed", "silence", "no-mark"]);
const PRUNE_MS = 5000;
/** How far the arrival of a broadcast's cues may be from their time on air, seconds (E25). */
const TOLERANCE_S = 10;

/** Data of the player by folder, fetched once a page. */
const loaded = new Map();

/** @param {string} base */
async function load(base) {
  /** @param {string} name @param {boolean} [needed] */
  const get = async (name, needed = true) => {
    const answer = await fetch(new URL(name, base));
    if (!answer.ok && needed) throw new Error(`${name}: ${answer.status}`);
    return answer.ok ? answer.arrayBuffer() : null;
  };
  const [module, voice, document, avatar] = await Promise.all(
    [get("cuecast.wasm"), get("voice.bin"), get("voice.json"), get("avatar.bin", false)],
  );
  return { module, voice, document: JSON.parse(new TextDecoder().decode(/** @type {ArrayBuffer} */ (document))), arrays: avatar && parseAvatar(avatar) };
}

class CuecastPlayer extends HTMLElement {
  /** @type {any} There once the files are. */
  cuer;
  /** @type {any} */
  model;
  /** @type {any} */
  clock;
  refresh = 0;
  pruning = 0;
  /** @type {HTMLMediaElement | null} The programme that is being drawn over. */
  opened = null;
  /** @type {any} Status of its proofs, if the page asked whose it is. */
  whose = null;

  static observedAttributes = [...Object.keys(CHOICES), ...Object.values(FLAGS), "lang", "avatar"];

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    // Not a <style>: a site's policy may forbid those (style-src without 'unsafe-inline').
    const style = new CSSStyleSheet();
    style.replaceSync(STYLE);
    root.adoptedStyleSheets = [style];
    const body = document.createElement("template");
    body.innerHTML = BODY;
    root.append(body.content);
    this.stage = new Stage(root);
    this.reception = "searching";
    this.reason = "";
    this.serial = 0;
    this.programme = 0;
    const slot = /** @type {HTMLSlotElement} */ (root.querySelector("slot"));
    slot.addEventListener("slotchange", () => { if (this.isConnected) this.open(); });
  }

  /** Folder of the player's files. */
  get base() {
    return new URL(this.getAttribute("base") || ".", this.hasAttribute("base") ? document.baseURI : import.meta.url).href;
  }

  set base(address) {
    this.setAttribute("base", address);
  }

  get media() {
    return /** @type {HTMLMediaElement | null} */ (this.querySelector("video, audio"));
  }

  /** Keys known so far around the present time: {start, end, shape, placement, phones}, media seconds. */
  get keyList() {
    return this.cuer ? [...this.cuer.timeline.keys] : [];
  }

  get timeline() {
    return this.cuer.timeline;
  }

  connectedCallback() {
    this.open();
  }

  disconnectedCallback() {
    this.serial += 1;
    this.deafen();
    this.attached?.abort();
    this.opened = null;
    cancelAnimationFrame(this.refresh);
    clearInterval(this.pruning);
    this.sizes?.disconnect();
  }

  attributeChangedCallback() {
    if (this.model) this.arrange();
  }

  /** The attributes by the television's names for settings. */
  get choice() {
    /** @type {any} */
    const choice = { layout: "over", captions: 0, dot: 100 };
    for (const name of Object.keys(CHOICES)) choice[name] = this.getAttribute(name) || CHOICES[name];
    for (const name of Object.keys(FLAGS)) choice[name] = this.hasAttribute(FLAGS[name]);
    return { ...choice, opacity: Number(choice.opacity) };
  }

  words() {
    return TEXTS[(this.lang || document.documentElement.lang || "en").slice(0, 2)] || TEXTS.en;
  }

  async open() {
    const { media } = this;
    if (media && this.opened === media) return;
    this.disconnectedCallback();
    const serial = this.serial;
    this.opened = media;
    if (!media) return this.because(obstacle(media));
    this.stage.video = media;
    try {
      if (!loaded.has(this.base)) loaded.set(this.base, load(this.base));
      const data = await loaded.get(this.base);
      const trust = await this.announcement();
      if (serial === this.serial) this.start(media, data, trust);
    } catch (error) {
      loaded.delete(this.base);
      this.because(error.reason || "no-files", error.message);
    }
  }

  /** The broadcaster's public file that the attribute `trust` names, and how late his cues may be. */
  async announcement() {
    const address = this.getAttribute("trust");
    if (!address) return {};
    const answer = await fetch(new URL(address, document.baseURI)).catch(() => null);
    if (!answer?.ok) throw Object.assign(new Error(`${address}: ${answer?.status ?? "no answer"}`), { reason: "no-key" });
    return { announcement: await answer.arrayBuffer(), toleranceS: Number(this.getAttribute("tolerance")) || TOLERANCE_S };
  }

  /** @param {HTMLMediaElement} media @param {any} data @param {any} trust */
  start(media, data, trust) {
    this.whose = trust.announcement ? { status: "unknown", of: "" } : null;
    const { module, voice, document, arrays } = data;
    if (this.data !== data) {
      const root = /** @type {ShadowRoot} */ (this.shadowRoot);
      /** @param {string} id */
      const find = (id) => /** @type {any} */ (root.getElementById(id));
      this.model = new VoiceModel(document);
      this.cuer = new Cuer(this.model, arrays, { points: find("points"), avatar: find("avatar") });
      this.data = data;
    }
    this.timeline.clear();
    this.clock = new ProgrammeClock(/** @type {HTMLVideoElement} */ (media));
    this.files = { module, voice, trust, worklet: new URL("worklet.js", this.base), worker: new URL("worker.js", this.base) };
    /** @type {HearingHandlers} */
    this.handlers = {
      heard: (message, offsetS) => this.take(message, offsetS),
      reason: (name, text) => (DEAF.has(name) ? this.lookBeside(name) : this.because(name, text)),
    };
    this.listen();
    this.sizes = new ResizeObserver(() => this.arrange());
    for (const part of [this, media]) this.sizes.observe(part);
    this.attached = new AbortController();
    const { signal } = this.attached;
    for (const name of ["loadedmetadata", "resize"]) media.addEventListener(name, () => this.arrange(), { signal });
    media.addEventListener("emptied", () => this.timeline.clear(), { signal });
    media.addEventListener("loadstart", () => this.listen(), { signal });
    this.pruning = setInterval(() => this.timeline.prune(media.currentTime), PRUNE_MS);
    this.arrange();
    this.refresh = requestAnimationFrame((now) => this.tick(now));
  }

  /** Begin with a programme: read the stream file named for it, or hear it. */
  listen() {
    this.deafen();
    this.programme += 1;
    this.triedBeside = false;
    this.because("");
    this.tellState("searching");
    if (this.hasAttribute("cue")) this.lookBeside("no-file");
    else this.hearing = new Hearing(/** @type {HTMLMediaElement} */ (this.media), /** @type {PlayerFiles} */ (this.files), this.handlers);
  }

  deafen() {
    this.hearing?.close();
    this.sidecar?.close();
    this.hearing = this.sidecar = null;
  }

  /** Take the stream file beside the programme, if there is one; else say why there is no cuer. @param {string} reason */
  async lookBeside(reason) {
    if (this.triedBeside) return this.because(this.sidecar ? "" : reason);
    this.triedBeside = true;
    const { programme, serial } = this;
    const media = /** @type {HTMLMediaElement} */ (this.media);
    const isPresent = () => programme === this.programme && serial === this.serial;
    const named = this.getAttribute("cue");
    try {
      const sidecar = await Sidecar.open(media, sidecarAddress(media, named), /** @type {PlayerFiles} */ (this.files), /** @type {HearingHandlers} */ (this.handlers));
      if (!isPresent()) return sidecar.close();
      this.deafen();
      this.sidecar = sidecar;
      this.because("");
      this.tellState("locked");
    } catch (error) {
      if (isPresent()) this.because(reason, named ? error.message : "");
    }
  }

  /** Bring the layout in line with attributes and size. */
  arrange() {
    const sound = this.stage.video.readyState > 0 && !this.stage.video.videoWidth;
    this.stage.root.classList.toggle("sound", sound);
    const { choice } = this;
    this.stage.arrange(choice, this.model.aspect);
    this.cuer.choose(choice.look);
    const own = this.getAttribute("avatar");
    const address = own ? new URL(own, document.baseURI).href : "";
    this.cuer.dress(choice.appearance, this.base, address).catch((/** @type {Error} */ error) => this.because("no-files", error.message));
    for (const canvas of Object.values(this.cuer.canvases)) canvas.setAttribute("aria-label", this.words().cuer);
  }

  /** Take what was heard; `offsetS` leads from the audio context's time to the media's. @param {any} message @param {number} offsetS */
  take({ events, pieces, diagnosis }, offsetS) {
    this.diagnosis = diagnosis ?? undefined;
    for (const piece of pieces) this.timeline.insert({ ...piece, startS: piece.startS + offsetS });
    for (const event of events) {
      const timeS = event.timeS + offsetS;
      if (event.kind === "key") this.takeKey(event, timeS);
      else if (event.kind === "state") this.tellState(event.state);
      else if (event.kind === "lost") this.tell("lost", { time: timeS, count: event.count });
      else if (event.kind === "proof") this.takeProof(event, timeS);
    }
  }

  /** @param {any} event @param {number} start */
  takeKey({ durationS, shape, placement, phones, final }, start) {
    const key = { start, end: start + durationS, shape, placement, phones };
    const { timeline } = this;
    /** @param {Key} known */
    const covers = (known) => Math.min(known.end, key.end) - Math.max(known.start, key.start) > 0.5 * (known.end - known.start);
    timeline.keys = timeline.keys.filter((/** @type {Key} */ known) => Math.abs(known.start - start) > 0.01 && !covers(known));
    if (durationS > 0) timeline.insertKeys([key]);
    if (final && durationS > 0) this.tell("key", key);
  }

  /** @param {any} event @param {number} timeS */
  takeProof(event, timeS) {
    if (!(timeS < this.whose?.timeS)) this.whose = { status: event.status, of: event.of.slice(0, 8), age_s: event.ageS, timeS };
    if (event.status === "verified") this.tell("verified", { time: timeS, of: event.of });
  }

  /** @param {string} state */
  tellState(state) {
    if (state === this.reception) return;
    this.reception = state;
    this.tell("state", { state, reason: this.reason, text: "" });
  }

  /** Say why there is no cuer; an empty name takes it back. @param {string} reason @param {string} [detail] */
  because(reason, detail = "") {
    if (reason === this.reason) return;
    this.reason = reason;
    if (detail) console.warn(`cuecast: ${reason}: ${detail}`);
    this.tell("state", { state: reason ? "deaf" : this.reception, reason, text: this.reasonText() });
    if (!this.hearing && !this.sidecar) this.showState(0);
  }

  reasonText() {
    const language = this.words() === TEXTS.fr ? "fr" : "en";
    return this.reason ? REASONS[this.reason][language] : "";
  }

  /** @param {string} name @param {any} detail */
  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  /** @param {number} visibility */
  showState(visibility) {
    const words = { ...this.words(), deaf: this.reasonText() };
    const received = this.reception === "locked" || this.reception === "degraded";
    const state = this.reason ? "deaf" : received && visibility === 0 ? "awaiting" : this.reception;
    this.stage.showStatus(state, words, this.whose || null);
    this.stage.status.hidden = !this.reason && this.media?.paused === true && visibility === 0;
  }

  /** @param {number} now */
  tick(now) {
    this.refresh = requestAnimationFrame((next) => this.tick(next));
    this.hearing?.tick();
    this.sidecar?.tick();
    const timeS = this.clock.at(now);
    const visibility = this.cuer.show(timeS, { ...this.choice, opacity: 100 });
    this.drawn = { timeS, nowMs: now, visibility };
    this.stage.showCuer(visibility > 0);
    this.showState(visibility);
    const { around } = this.stage;
    this.stage.showKeys(this.cuer.keysAround(timeS, around, around), this.words());
  }
}

if (!customElements.get("cuecast-player")) customElements.define("cuecast-player", CuecastPlayer);
return { CuecastPlayer };
})();

export const { CuecastPlayer } = $element;
