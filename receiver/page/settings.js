/** What the viewer chose: checked, remembered in the browser, shown in the panel of settings. */

/** @type {Record<string, string[]>} */
export const CHOICES = {
  style: ["avatar", "points"],
  appearance: ["woman", "man", "elder"],
  layout: ["beside", "over"],
  place: ["bottom-right", "bottom-left", "top-right", "top-left", "free"],
  size: ["small", "medium", "large", "whole"],
  contrast: ["panel", "outline", "strong"],
  ground: ["shade", "box", "none"],
  language: ["fr", "en"],
};
/** Least, most and step. @type {Record<string, number[]>} */
const RANGES = {
  opacity: [20, 100, 5], dot: [40, 200, 5], delay: [-500, 500, 20], captions: [0, 10, 1],
  left: [0, 100, 1], top: [0, 100, 1], width: [10, 100, 1],
};
const SWITCHES = ["mirror", "handOnly", "keys"];
/** @type {Record<string, any>} */
const DEFAULTS = {
  style: "avatar", appearance: "woman", layout: "beside", place: "bottom-right", size: "large", contrast: "panel",
  language: (navigator.language || "fr").startsWith("fr") ? "fr" : "en",
  opacity: 100, dot: 100, delay: 0, captions: 4, ground: "shade", left: 100, top: 100, width: 30,
  mirror: false, handOnly: false, keys: true,
};
const ORDER = [
  "layout", "size", "place", "left", "top", "width", "style", "appearance", "mirror", "handOnly", "delay", "contrast", "opacity", "dot",
  "keys", "captions", "ground", "language",
];
/** @type {Words} */
const UNITS = { opacity: "%", dot: "%", delay: "ms", captions: "%", left: "%", top: "%", width: "%" };
/** @type {Words} */
const LANGUAGES = { fr: "Français", en: "English" };
const FREE = ["left", "top", "width"];
const STORE = "cuecast.settings";

export class Settings {
  /** @param {() => void} changed */
  constructor(changed) {
    this.changed = changed;
    this.values = Object.assign({}, DEFAULTS);
    this.absent = new Set();
    /** @type {Record<string, {title: HTMLLabelElement, control: any}>} */
    this.rows = {};
    /** @type {Words} */
    this.shown = {};
    const stored = read();
    for (const name of Object.keys(DEFAULTS)) if (valid(name, stored[name])) this.values[name] = stored[name];
  }

  /** @param {string} name */
  get(name) {
    return this.values[name];
  }

  /** @param {string} name @param {any} value */
  set(name, value) {
    this.setAll({ [name]: value });
  }

  /** Take several values at once, those that are valid. @param {Record<string, any>} values */
  setAll(values) {
    for (const name of Object.keys(values)) if (valid(name, values[name])) this.values[name] = values[name];
    try {
      localStorage.setItem(STORE, JSON.stringify(this.values));
    } catch (error) {
      if (error.name !== "SecurityError" && error.name !== "QuotaExceededError") throw error;
    }
    this.refresh();
    this.changed();
  }

  /** @param {string} name */
  toggle(name) {
    this.set(name, !this.values[name]);
  }

  /** @param {string} name */
  next(name) {
    const list = CHOICES[name];
    this.set(name, list[(list.indexOf(this.values[name]) + 1) % list.length]);
  }

  /** Leave a setting out: this television cannot follow it. @param {string} name */
  withhold(name) {
    this.absent.add(name);
  }

  /** Fill `parent` with one labelled control per setting, in the words of a language. @param {HTMLElement} parent @param {Words} words */
  show(parent, words) {
    if (this.shown === words) return;
    this.shown = words;
    parent.textContent = "";
    for (const name of ORDER) {
      const control = this.control(name, words);
      control.id = `set-${name}`;
      const title = document.createElement("label");
      title.htmlFor = control.id;
      title.textContent = words[name];
      parent.append(title, control);
      this.rows[name] = { title, control };
    }
    this.refresh();
  }

  /** Bring the controls in line with the values; places of one's own only where there is one. */
  refresh() {
    for (const [name, { title, control }] of Object.entries(this.rows)) {
      const needless = FREE.includes(name) && (this.values.place !== "free" || this.values.layout !== "over");
      title.hidden = control.hidden = this.absent.has(name) || needless;
      if (SWITCHES.includes(name)) control.checked = this.values[name];
      else control.value = this.values[name];
      if (UNITS[name]) title.textContent = `${this.shown[name]} : ${this.values[name]} ${UNITS[name]}`;
    }
  }

  /** @param {string} name @param {Words} words */
  control(name, words) {
    if (CHOICES[name]) return this.select(name, words);
    const input = document.createElement("input");
    input.type = RANGES[name] ? "range" : "checkbox";
    if (RANGES[name]) [input.min, input.max, input.step] = RANGES[name].map(String);
    input.oninput = () => this.set(name, RANGES[name] ? Number(input.value) : input.checked);
    return input;
  }

  /** @param {string} name @param {Words} words */
  select(name, words) {
    const select = document.createElement("select");
    for (const value of CHOICES[name]) {
      const title = name === "language" ? LANGUAGES[value] : words[value];
      select.add(new Option(title, value));
    }
    select.onchange = () => this.set(name, select.value);
    return select;
  }
}

/** @param {string} name @param {any} value */
function valid(name, value) {
  if (CHOICES[name]) return CHOICES[name].includes(value);
  if (RANGES[name]) return Number.isFinite(value) && value >= RANGES[name][0] && value <= RANGES[name][1];
  return SWITCHES.includes(name) && typeof value === "boolean";
}

function read() {
  try {
    const stored = JSON.parse(localStorage.getItem(STORE) || "{}");
    return stored && typeof stored === "object" ? stored : {};
  } catch {
    return {};
  }
}
