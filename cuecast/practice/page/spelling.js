/** French words of keys: phones as they are spelled, names of places. */

/** @type {Words} */
const LETTERS = {
  "ɔ̃": "on", "ɑ̃": "an", "ɛ̃": "in", "œ̃": "un", u: "ou", y: "u", "ø": "eu", "œ": "eu", "ə": "e", o: "o", "ɔ": "o", e: "é", "ɛ": "è",
  a: "a", "ɑ": "a", i: "i", "ʃ": "ch", "ʒ": "j", "ɲ": "gn", "ŋ": "ng", "ʁ": "r", j: "i", w: "w", "ɥ": "u", k: "k", s: "s", z: "z",
};

/** @type {Words} */
export const PLACES = { rest: "repos", side: "côté", mouth: "bouche", chin: "menton", cheek: "pommette", throat: "gorge" };

/** A phone as a learner writes it. @param {string} phone */
export function spelled(phone) {
  return LETTERS[phone] || phone;
}

/** @type {Words} */
const GLIDES = { "ɥ": "ui", w: "oi", j: "y" };

/** A phone by itself, without a neighbour that would make a glide plain. @param {string} phone */
export function alone(phone) {
  return GLIDES[phone] || spelled(phone);
}

/** Phones of a group, each spelling once. @param {string[]} phones */
export function group(phones) {
  return [...new Set(phones.map(alone))].join(" ");
}
