/** French words of keys: phones as charts for learners spell them, names of places. */

/** @type {Words} */
const LETTERS = {
  "ɔ̃": "on", "ɑ̃": "an", "ɛ̃": "in", "œ̃": "un", u: "ou", y: "u", "ø": "eu", "ə": "e", "ɔ": "ò", e: "é", "ɛ": "è",
  "ɑ": "a", "ʃ": "ch", "ʒ": "j", "ɲ": "gn", "ŋ": "ng", "ʁ": "r", j: "y", "ɥ": "u",
};

/** @type {Words} */
export const PLACES = { rest: "repos", side: "côté", mouth: "bouche", chin: "menton", cheek: "pommette", throat: "gorge" };

/** A phone as a learner writes it. @param {string} phone */
export function spelled(phone) {
  return LETTERS[phone] || phone;
}

/** A phone by itself: the glide of “huit” is spelled “ui” to keep it apart from the vowel. @param {string} phone */
export function alone(phone) {
  return phone === "ɥ" ? "ui" : spelled(phone);
}

/** Phones of a group, each spelling once. @param {string[]} phones */
export function group(phones) {
  return [...new Set(phones.map(alone))].join(" ");
}
