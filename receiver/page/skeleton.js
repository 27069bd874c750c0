/**
 * The cuer's arm as one chain, and the motions of head and hand with what the rules add: the same
 * as `receiver.drawing.skeleton`. A motion is a rotation vector and a shift; a map `{turn, shift}`
 * has 9 numbers row by row, and 3.
 */

import { rotation } from "./model.js";

const POINTING = 16;
/** Distances in mm: within the first a place's shift holds, beyond the second none does. */
const NEAR_MM = 12;
const FAR_MM = 120;

export class Skeleton {
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
