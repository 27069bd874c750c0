/**
 * The avatar: a skin that follows the markers, drawn with WebGL.
 *
 * A linear map gives a coarse mesh from the markers before head and forearm move them; a finer
 * surface lies over it; the graphics processor moves both parts rigidly and lights them. The same
 * numbers as `receiver.avatar`, the same light as `receiver.portrait`.
 */

import { Movement } from "./movement.js";
import { Mouth } from "./mouth.js";
import { fit } from "./points.js";
import { Shading } from "./shading.js";
import { Skeleton } from "./skeleton.js";

/** @type {Record<string, any>} */
const KINDS = { f4: Float32Array, i2: Int16Array, u2: Uint16Array, u1: Uint8Array };
const SHARE_UNIT = 252;
const OFFSET_UNIT = 256;
const ORIGIN = [0, 0, 0];
/** Decode `/avatar.bin`: `{name: typed array}`. @param {ArrayBuffer} buffer */
export function parseAvatar(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  /** @type {Arrays} */
  const arrays = {};
  for (const [name, kind, offset, size] of header) arrays[name] = new KINDS[kind](buffer, 4 + length + offset, size);
  return arrays;
}

/** Head or hand: markers to vertices and normals. */
export class Surface {
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

export class AvatarView {
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
