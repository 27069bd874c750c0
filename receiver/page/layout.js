/**
 * Where everything stands on a screen: rectangles {left, top, width, height} in CSS pixels.
 *
 * Beside the programme the cuer has a share of the screen's width, below it on an upright screen
 * all of the width; over the programme she has a share of its height. Nothing lies on her: the line
 * of keys, captions, controls and settings go where she is not.
 */

/** Share of the width that she has beside the programme, and of its height over it. @type {Record<string, number>} */
const BESIDE = { small: 1 / 6, medium: 1 / 4, large: 1 / 3 };
/** @type {Record<string, number>} */
const OVER = { small: 0.36, medium: 0.5, large: 0.72 };
const MARGIN = 0.025;
/** Share of the width that the programme keeps where the cuer has the screen. */
const THUMBNAIL = 0.25;
/** Least and usual most size of the keys' letters: below it the names of placements do not fit. */
const LETTERS = [19, 34];
/** Width and height of a key in sizes of its letters, with its gap. */
const KEY_EM = [3.7, 2.6];
const CAPTION_LINES = 2.9;

/** @param {number} least @param {number} value @param {number} most */
const clamp = (least, value, most) => Math.max(least, Math.min(value, most));
/** @param {number} left @param {number} top @param {number} width @param {number} height */
const box = (left, top, width, height) => ({ left, top, width, height });
/** @param {Box} a @param {Box} b */
const meets = (a, b) => a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;

/** The largest rectangle of `ratio` in the middle of `area`. @param {Box} area @param {number} ratio */
function fitted(area, ratio) {
  const width = Math.min(area.width, area.height * ratio);
  const height = width / ratio;
  return box(area.left + (area.width - width) / 2, area.top + (area.height - height) / 2, width, height);
}

/** The largest of the four rectangles around `cuer` within `area`. @param {Box} area @param {Box} cuer */
function freeOf(area, cuer) {
  const right = area.left + area.width;
  const bottom = area.top + area.height;
  const around = [
    box(area.left, area.top, cuer.left - area.left, area.height),
    box(cuer.left + cuer.width, area.top, right - cuer.left - cuer.width, area.height),
    box(area.left, area.top, area.width, cuer.top - area.top),
    box(area.left, cuer.top + cuer.height, area.width, bottom - cuer.top - cuer.height),
  ];
  /** @param {Box} box */
  const worth = ({ width, height }) => Math.min(width, 480) * Math.min(height, 640);
  return around.reduce((best, one) => (worth(one) > worth(best) ? one : best));
}

/** Letters of the keys and how many keys stand on each side of the present one, in `width`. @param {Size} screen @param {number} width */
function keyLine(screen, width) {
  const vmin = Math.min(screen.width, screen.height);
  const size = clamp(LETTERS[0], 0.031 * vmin, LETTERS[1]);
  const around = width >= 5 * KEY_EM[0] * LETTERS[0] ? 2 : 1;
  return { around, size: clamp(11, width / ((2 * around + 1) * KEY_EM[0]), size) };
}

/**
 * The layout of a screen.
 *
 * `screen`: {width, height}; `picture`: the programme's rectangle where the page placed it itself,
 * else null; `ratio` of the programme, 0 without a picture; `aspect` of the cuer; `choice`:
 * {layout, size, place, left, top, width (percent), keys, captions (letters' size in percent of
 * the screen's smaller side, 0 without)}.
 * @param {Size} screen @param {Box|null} picture @param {number} ratio @param {number} aspect
 * @param {LayoutChoice} choice
 */
export function layoutOf(screen, picture, ratio, aspect, choice) {
  const area = box(0, 0, screen.width, screen.height);
  /** @type {Record<string, (area: Box, choice: LayoutChoice, aspect: number, picture: Box | null, ratio: number) => Omit<Layout, "kind" | "panel">>} */
  const makers = { alone, whole, below, beside, over };
  const isUpright = screen.height > 1.15 * screen.width;
  let kind = choice.layout === "beside" ? (isUpright ? "below" : "beside") : "over";
  if (choice.size === "whole") kind = "whole";
  if (!ratio) kind = "alone";
  const made = makers[kind](area, choice, aspect, picture, ratio);
  return { kind, ...made, panel: freeOf(area, kind === "alone" || kind === "whole" ? box(area.width * 0.5, 0, area.width * 0.5, area.height) : made.cuer) };
}

/** @param {Box} area @param {LayoutChoice} choice @param {number} width */
function bandOf(area, choice, width) {
  const line = keyLine(area, width);
  return { ...line, height: choice.keys ? KEY_EM[1] * line.size : 0 };
}

/** @param {Box} area @param {LayoutChoice} choice */
const letters = (area, choice) => choice.captions / 100 * Math.min(area.width, area.height);
/** @param {Box} area @param {LayoutChoice} choice */
const captionsOf = (area, choice) => Math.max(choice.captions && 15, letters(area, choice)) * CAPTION_LINES;

/** The cuer in a column or row with her keys under her. @param {Box} space @param {number} aspect @param {KeyBand} band */
function standing(space, aspect, band) {
  const cuer = fitted(box(space.left, space.top, space.width, space.height - band.height), aspect);
  cuer.top = space.top + (space.height - band.height - cuer.height) / 2;
  const keys = { ...band, ...box(space.left, cuer.top + cuer.height, space.width, band.height) };
  return { cuer, keys };
}

/** A programme without picture leaves the screen to her. @param {Box} area @param {LayoutChoice} choice @param {number} aspect */
function alone(area, choice, aspect) {
  const text = captionsOf(area, choice);
  const space = box(0, 0, area.width, area.height - text);
  const captions = box(0, space.height, area.width, text);
  return { ...standing(space, aspect, bandOf(area, choice, area.width)), programme: area, captions, bar: area };
}

/**
 * She has the screen, the programme a corner of it.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} picture @param {number} ratio
 */
function whole(area, choice, aspect, picture, ratio) {
  const text = captionsOf(area, choice);
  const space = box(0, 0, area.width, area.height - text);
  const stood = standing(space, aspect, bandOf(area, choice, area.width));
  const captions = box(0, space.height, area.width, text);
  if (picture) return { ...standing(picture, aspect, bandOf(area, choice, picture.width)), programme: picture, captions, bar: area };
  const side = Math.max((area.width - stood.cuer.width) / 2 - 16, THUMBNAIL * area.width, area.height > area.width ? 0.5 * area.width : 0);
  const width = Math.min(side, 0.5 * area.width);
  const margin = MARGIN * area.height;
  const left = choice.place.endsWith("left") ? area.width - margin - width : margin;
  return { ...stood, programme: box(left, margin, width, width / ratio), captions, bar: area };
}

/**
 * Upright screens: the programme above, captions, the cuer as wide as the screen, her keys.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} _picture
 * @param {number} ratio
 */
function below(area, choice, aspect, _picture, ratio) {
  const text = captionsOf(area, choice);
  const height = Math.min(area.width / ratio, 0.4 * area.height);
  const programme = fitted(box(0, 0, area.width, height), ratio);
  const space = box(0, height + text, area.width, area.height - height - text);
  const row = choice.size === "large" ? space : box(space.left, space.top, space.width, space.height * (choice.size === "medium" ? 0.8 : 0.6));
  const captions = box(0, height, area.width, text);
  return { ...standing(row, aspect, bandOf(area, choice, area.width)), programme, captions, bar: box(0, 0, area.width, height) };
}

/**
 * She has a column of the screen; the programme shrinks to the rest, captions under it.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} _picture
 * @param {number} ratio
 */
function beside(area, choice, aspect, _picture, ratio) {
  const width = area.width * BESIDE[choice.size];
  const isLeft = choice.place.endsWith("left");
  const column = box(isLeft ? 0 : area.width - width, 0, width, area.height);
  const rest = box(isLeft ? width : 0, 0, area.width - width, area.height);
  const text = captionsOf(area, choice);
  const height = Math.min(rest.width / ratio, area.height);
  const programme = fitted(box(rest.left, Math.max(0, (area.height - height - text) / 2), rest.width, height), ratio);
  const captions = box(rest.left, Math.min(programme.top + height, area.height - text), rest.width, text);
  return { ...standing(column, aspect, bandOf(area, choice, width)), programme, captions, bar: rest };
}

/**
 * She stands over the programme, in a corner or where the viewer put her.
 * @param {Box} area @param {LayoutChoice} choice @param {number} aspect @param {Box|null} picture @param {number} ratio
 */
function over(area, choice, aspect, picture, ratio) {
  const programme = picture || fitted(area, ratio);
  const cuer = choice.place === "free" ? placed(programme, choice, aspect) : cornered(programme, choice, aspect);
  const { left, top, width, height } = programme;
  const right = left + width - cuer.left - cuer.width;
  const text = captionsOf(area, choice);
  const line = bandOf(area, choice, Math.max(cuer.left - left, right, 0.5 * width));
  const lift = 0.03 * height + text;
  const keys = keysClear(programme, cuer, line, right, lift);
  const captions = box(left, top + 0.985 * height - text, width, text);
  if (meets(captions, cuer)) [captions.left, captions.width] = freeSpan(programme, cuer);
  return { cuer, keys, programme, captions, bar: area };
}

/**
 * The line of keys in the first row that she leaves free; without one, smaller beside her.
 * @param {Box} programme @param {Box} cuer @param {KeyBand} line @param {number} right @param {number} lift
 */
function keysClear({ left, top, width, height }, cuer, line, right, lift) {
  /** @param {KeyLine} line */
  const needs = ({ around, size }) => (2 * around + 1) * KEY_EM[0] * size;
  const low = top + height - lift - line.height;
  /** @type {[number, number, number][]} */
  const spans = [[left, low, width], [left, low, cuer.left - left], [cuer.left + cuer.width, low, right], [left, top, width]];
  /** @param {[number, number, number]} span @param {KeyBand} one */
  const within = ([x, y, w], one) => ({ ...one, ...box(x + (w - needs(one)) / 2, y, needs(one), line.height) });
  const free = spans.find((span) => span[2] >= needs(line) && !meets(within(span, line), cuer));
  if (free) return within(free, line);
  const side = spans[1][2] > right ? spans[1] : spans[2];
  const least = { ...line, around: 1 };
  return within(side, { ...least, size: line.size * Math.min(1, side[2] / needs(least)) });
}

/** The wider part of the programme's width that she leaves: left edge and width. @param {Box} programme @param {Box} cuer */
function freeSpan({ left, width }, cuer) {
  const before = cuer.left - left;
  const after = left + width - cuer.left - cuer.width;
  return before >= after ? [left, before] : [cuer.left + cuer.width, after];
}

/** @param {Box} programme @param {LayoutChoice} choice @param {number} aspect */
function cornered(programme, { size, place }, aspect) {
  const { left, top, width, height } = programme;
  const high = Math.min(height * OVER[size], width / aspect);
  const margin = MARGIN * height;
  const [vertical, horizontal] = place.split("-");
  const x = horizontal === "left" ? left + margin : left + width - margin - high * aspect;
  return box(x, vertical === "top" ? top + margin : top + height - margin - high, high * aspect, high);
}

/** @param {Box} programme @param {LayoutChoice} choice @param {number} aspect */
function placed(programme, { left, top, width }, aspect) {
  const wide = Math.min(programme.width * width / 100, programme.height * aspect);
  const high = wide / aspect;
  return box(programme.left + left / 100 * (programme.width - wide), programme.top + top / 100 * (programme.height - high), wide, high);
}
