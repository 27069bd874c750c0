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

export class Mouth {
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
