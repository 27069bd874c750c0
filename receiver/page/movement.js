/**
 * What the cuer's face and trunk do beside the parameters on air: lids, gaze, brows, head, breath.
 *
 * The same as `receiver.drawing.movement`, by the same table, which travels in the voice's document.
 */

export class Movement {
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
export function chance(number) {
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
