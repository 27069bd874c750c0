/** What the viewer chose: checked, remembered in the browser, shown in the panel of settings. */

export const CHOICES = {
  style: ["avatar", "points"],
  place: ["bottom-right", "bottom-left", "top-right", "top-left"],
  size: ["small", "medium", "large", "whole"],
  contrast: ["panel", "outline", "strong"],
  language: ["fr", "en"],
};
const RANGES = { opacity: [20, 100], dot: [40, 200] };
const SWITCHES = ["mirror", "handOnly", "keys"];
const DEFAULTS = {
  style: "avatar", place: "bottom-right", size: "medium", contrast: "panel",
  language: (navigator.language || "fr").startsWith("fr") ? "fr" : "en",
  opacity: 100, dot: 100, mirror: false, handOnly: false, keys: true,
};
const STORE = "cuecast.settings";

export class Settings {
  constructor(changed) {
    this.changed = changed;
    this.values = Object.assign({}, DEFAULTS);
    const stored = read();
    for (const name of Object.keys(DEFAULTS)) if (valid(name, stored[name])) this.values[name] = stored[name];
  }

  get(name) {
    return this.values[name];
  }

  set(name, value) {
    if (!valid(name, value)) return;
    this.values[name] = value;
    try {
      localStorage.setItem(STORE, JSON.stringify(this.values));
    } catch (error) {
      if (error.name !== "SecurityError" && error.name !== "QuotaExceededError") throw error;
    }
    this.changed(name);
  }

  toggle(name) {
    this.set(name, !this.values[name]);
  }

  next(name) {
    const list = CHOICES[name];
    this.set(name, list[(list.indexOf(this.values[name]) + 1) % list.length]);
  }

  /** Fill `parent` with one labelled control per setting. */
  show(parent, words) {
    parent.textContent = "";
    for (const name of ["style", "place", "size", "contrast", "opacity", "dot", "mirror", "handOnly", "keys", "language"]) {
      const control = this.control(name, words);
      control.id = `set-${name}`;
      const title = document.createElement("label");
      title.htmlFor = control.id;
      title.textContent = words[name];
      parent.append(title, control);
    }
  }

  control(name, words) {
    if (CHOICES[name]) return this.select(name, words);
    const input = document.createElement("input");
    input.type = RANGES[name] ? "range" : "checkbox";
    if (RANGES[name]) [input.min, input.max] = RANGES[name];
    if (RANGES[name]) input.value = this.values[name];
    else input.checked = this.values[name];
    input.oninput = () => this.set(name, RANGES[name] ? Number(input.value) : input.checked);
    return input;
  }

  select(name, words) {
    const select = document.createElement("select");
    for (const value of CHOICES[name]) {
      const title = name === "language" ? { fr: "Français", en: "English" }[value] : words[value];
      select.add(new Option(title, value, false, value === this.values[name]));
    }
    select.onchange = () => this.set(name, select.value);
    return select;
  }
}

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
