/** The numbers of hand placements, as `codec.score.PLACEMENTS` orders them. */

export const PLACEMENT_NUMBER = { rest: 0, side: 1, mouth: 2, chin: 3, cheek: 4, throat: 5 };

/** Share of a stroke after which the hand is nearer to the new key than to the old one. */
const CROSSED = 0.4;

/** A way between two placements as they come, mm. */
const TYPICAL_WAY_MM = 60;

/** Share of the consonant in a key of two phones, as cuers speak. */
const CONSONANT = 0.5;

/** Share of the way to rest at which the hand shows its key no more. */
const GONE = 0.3;

/**
 * When the hand begins to show a key, seconds: it runs ahead of the lips.
 *
 * `movement` has the voice's constants of `codec.cuer.movement`; `before` is the key before, if any.
 */
export function handStart(key, before, movement) {
  const gap = before ? key.start - before.end : Infinity;
  let lead = Math.min(movement.first_lead_s, gap / 2);
  if (before && gap < movement.rest_gap_s) {
    const apart = key.start - before.start;
    const quick = Math.min(apart, movement.hurried_s);
    const most = movement.most_lead_s + TYPICAL_WAY_MM * movement.lead_s_per_mm;
    lead = Math.min(movement.lead_share * quick + movement.calm_share * (apart - quick), most);
    lead = Math.max(lead, movement.least_lead_s);
  }
  const lag = key.phones.length > 1 ? movement.lag_share * CONSONANT * (key.end - key.start) : 0;
  return key.start - lead + CROSSED * (lead + lag);
}

/** When the hand shows a key no more, if it goes to rest after it, seconds. */
export function handEnd(key, movement) {
  return key.end + movement.rest_delay_s + GONE * movement.rest_move_s;
}
