/** The numbers of hand placements, as `codec.score.PLACEMENTS` orders them. */

/** @type {Record<string, number>} */
export const PLACEMENT_NUMBER = { rest: 0, side: 1, mouth: 2, chin: 3, cheek: 4, throat: 5 };

/**
 * Share of a stroke after which the hand is nearer to the new key than to the old one: where the
 * fingers alone change, which run ahead, where the place alone does, and where both do.
 */
const CROSSED = { shape: 0.42, place: 0.56, both: 0.47 };

/** Share of the consonant in a key of two phones, as cuers speak. */
const CONSONANT = 0.5;

/** Share of the way to rest at which the hand shows its key no more. */
const GONE = 0.3;

/** A time before any that occurs, seconds. */
const LONG_AGO_S = -1e6;

const REST = { shape: 0, placement: "rest", leave: LONG_AGO_S, reach: LONG_AGO_S };

/**
 * The hand's strokes to `keys`, in order: each key's `{shape, placement, leave, reach}`, seconds.
 *
 * The rule of `codec.superframe.resynthesis.movements`; `movement` has the voice's constants of
 * `codec.cuer.movement` and `places`, where its hand is for each key, mm.
 * @param {Key[]} keys @param {HandMovement} movement
 */
export function strokesTo(keys, movement) {
  /** @type {Stroke[]} */
  const strokes = [];
  let last = REST;
  keys.forEach((key, i) => {
    const before = keys[i - 1];
    const gap = before ? key.start - before.end : Infinity;
    const rested = gap >= movement.rest_gap_s;
    const lead = rested ? Math.min(movement.first_lead_s, gap / 2) : 0;
    if (rested && before) last = strokeToRest(before, last, key.start - lead, movement);
    const way = distance(last, key, movement.places);
    const leave = key.start - (rested ? lead : leadOf(key.start - before.start, way, movement));
    const lag = key.phones.length > 1 ? movement.lag_share * CONSONANT * (key.end - key.start) : 0;
    last = strokeTo(key, last, leave, key.start + lag, way, movement);
    strokes.push(last);
  });
  return strokes;
}

/** When the hand begins to show the key of a stroke, seconds: it runs ahead of the lips. @param {Stroke} stroke @param {Stroke} [before] */
export function shownFrom(stroke, before = REST) {
  const turns = stroke.shape !== before.shape;
  const goes = stroke.placement !== before.placement;
  const share = CROSSED[turns && goes ? "both" : goes ? "place" : "shape"];
  return stroke.leave + share * (stroke.reach - stroke.leave);
}

/** When the hand shows a key no more, if it goes to rest after it, seconds. @param {Key} key @param {Stroke} stroke @param {HandMovement} movement */
export function shownUntil(key, stroke, movement) {
  const rest = strokeToRest(key, stroke, Infinity, movement);
  return rest.leave + GONE * (rest.reach - rest.leave);
}

/** @param {number} apart @param {number} way @param {HandMovement} movement */
function leadOf(apart, way, movement) {
  const quick = Math.min(apart, movement.hurried_s);
  const most = movement.most_lead_s + movement.lead_s_per_mm * way;
  const lead = movement.lead_share * quick + movement.calm_share * (apart - quick);
  return Math.max(Math.min(lead, most), movement.least_lead_s);
}

/** @param {Key} key @param {Stroke} last @param {number} leave @param {number} target @param {number} way @param {HandMovement} movement */
function strokeTo({ shape, placement }, last, leave, target, way, movement) {
  const least = 1.875 * way / (1000 * movement.fastest_m_s);
  leave = Math.max(Math.min(leave, target - least), freeAfter(last, movement));
  const late = Math.min(leave + least, target + movement.late_s);
  return { shape, placement, leave, reach: Math.max(target, late, leave + movement.shortest_s) };
}

/** @param {Key} key @param {Stroke} last @param {number} until @param {HandMovement} movement */
function strokeToRest(key, last, until, movement) {
  const leave = Math.max(key.end + movement.rest_delay_s, freeAfter(last, movement));
  const reach = Math.max(Math.min(leave + movement.rest_move_s, until), leave + movement.shortest_s);
  return { ...REST, leave, reach };
}

/** @param {Stroke} stroke @param {HandMovement} movement */
function freeAfter(stroke, movement) {
  return stroke.reach - movement.overlap * (stroke.reach - stroke.leave);
}

/** @param {HandKey} one @param {HandKey} other @param {number[][]} places */
function distance(one, other, places) {
  const from = places[6 * one.shape + PLACEMENT_NUMBER[one.placement]];
  const to = places[6 * other.shape + PLACEMENT_NUMBER[other.placement]];
  return Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
}
