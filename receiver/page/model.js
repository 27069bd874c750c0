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
export function rotation(x, y, z, out) {
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

export class VoiceModel {
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
