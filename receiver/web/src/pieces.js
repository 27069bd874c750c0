/** Frames of motion, some of them shown anew by later superframes, as whole pieces for the timeline. */

const RATE_HZ = 50;
const KEPT = 12;
const MOST_FRAMES = 32;

export class Pieces {
  constructor() {
    /** @type {Rows[]} */
    this.pieces = [];
    /** @type {Set<Rows>} */
    this.changed = new Set();
  }

  /** Take an event of motion. @param {{timeS: number, layers: number, values: Float32Array}} event */
  add({ timeS, layers, values }) {
    /** @param {Rows} piece */
    const at = (piece) => Math.round((timeS - piece.startS) * RATE_HZ);
    /** @param {Rows} piece */
    const fits = (piece) => at(piece) >= 0 && at(piece) <= Math.min(piece.rows.length, MOST_FRAMES - 1);
    let piece = this.pieces.find(fits);
    if (!piece) {
      piece = { startS: timeS, layers, rows: [] };
      this.pieces.push(piece);
      if (this.pieces.length > KEPT) this.pieces.shift();
    }
    piece.rows[at(piece)] = values;
    piece.layers = layers;
    this.changed.add(piece);
  }

  /** The pieces that changed since the last call, as `receiver/page/timeline.js` takes them. */
  take() {
    const out = [...this.changed].map(({ startS, layers, rows }) => {
      const width = rows[0].length;
      const frames = new Float32Array(rows.length * width);
      rows.forEach((row, i) => frames.set(row, i * width));
      return { startS, layers, rateHz: RATE_HZ, count: rows.length, width, frames, concealed: layers === 0 };
    });
    this.changed.clear();
    return out;
  }
}
