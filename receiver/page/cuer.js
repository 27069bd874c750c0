/**
 * The cuer over the programme's clock: motion that was received, sampled and drawn on two canvases.
 *
 * The television's page and `<cuecast-player>` show her by this class; each adds its own controls.
 */

import { AvatarView, parseAvatar } from "./avatar.js";
import { HandReader } from "./hand.js";
import { PointLights } from "./points.js";
import { Timeline } from "./timeline.js";

/** Radius of a point in hundredths of the picture's height, at the usual size. */
const DOT = 0.62;

export class Cuer {
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
