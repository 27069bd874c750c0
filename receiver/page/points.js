/**
 * Point lights: one disc per marker on a transparent canvas, far discs smaller and first.
 *
 * The camera is `{centre: [x, y, z], height_mm, distance_mm}`: `centre` falls into the middle of
 * the picture, `height_mm` fills its height, and depth shrinks by distance / (distance - depth).
 */

export class PointLights {
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
export function fit(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
