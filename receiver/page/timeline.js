/**
 * The cuer's parameters over the programme's clock: pieces of motion in any order, sampled anywhere.
 *
 * A piece is `{startS, rateHz, count, width, frames, concealed, layers}`; `frames` holds
 * count x width numbers. Pieces that join within half a frame are interpolated across the joint.
 */

import { shownFrom, shownUntil, strokesTo } from "./keys.js";

export const HOLD_S = 0.35;
export const FADE_S = 0.45;
const KEPT_S = 300;

/** How far from the present keys can bear on what the hand shows, seconds. */
const NEAR_S = 4;

/** How far the drawn hand may be ahead of its clock or behind, seconds. */
const SLACK_S = 0.25;

export class Timeline {
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
