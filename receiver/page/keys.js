/** The numbers of hand placements, as `codec.score.PLACEMENTS` orders them. */

export const PLACEMENT_NUMBER = { rest: 0, side: 1, mouth: 2, chin: 3, cheek: 4, throat: 5 };
