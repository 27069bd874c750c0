/** Which key the drawn hand shows: the nearest of the voice's hand shapes and placements. */

import { PLACEMENT_NUMBER } from "./keys.js";
import { rotation } from "./model.js";

const PLACEMENTS = Object.keys(PLACEMENT_NUMBER);

/** The placement at which shapes are compared: every shape occurs there. */
const SIDE = PLACEMENT_NUMBER.side;

export class HandReader {
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
