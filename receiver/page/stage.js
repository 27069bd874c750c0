/** What stands over the picture: the cuer's inset, the line of keys, the state of reception. */

import { PLACEMENT_NUMBER } from "./keys.js";

const HEIGHTS = { small: 0.36, medium: 0.5, large: 0.72, whole: 1 };
const MARGIN = 0.025;
/** Share of the bar's upper padding that is only its fading edge. */
const BAR_FADE = 0.7;

export class Stage {
  constructor(document) {
    const find = (id) => document.getElementById(id);
    this.root = find("stage");
    this.video = find("programme");
    this.inset = find("inset");
    this.bar = find("bar");
    this.keysLine = find("keys");
    this.status = find("status");
    this.statusText = find("status-text");
    this.toast = find("toast");
    this.shownKeys = "";
  }

  /** The rectangle that the picture fills inside the stage (letterboxed), in CSS pixels. */
  picture() {
    const { videoWidth, videoHeight } = this.video;
    const stage = this.root.getBoundingClientRect();
    // A page may put margins and other elements around the video.
    const { left, top, width, height } = videoWidth ? this.video.getBoundingClientRect() : stage;
    const ratio = videoWidth ? videoWidth / videoHeight : width / height;
    const shown = Math.min(width, height * ratio);
    return {
      left: left - stage.left + (width - shown) / 2,
      top: top - stage.top + (height - shown / ratio) / 2,
      width: shown,
      height: shown / ratio,
    };
  }

  /** Place the inset over the picture; a programme without picture leaves the stage to the cuer. */
  arrange(settings, aspect) {
    const alone = this.video.readyState > 0 && !this.video.videoWidth;
    const whole = alone || settings.get("size") === "whole";
    const box = this.picture();
    const height = whole ? box.height : box.height * HEIGHTS[settings.get("size")];
    const width = whole ? box.width : height * aspect;
    const margin = whole ? 0 : MARGIN * box.height;
    const [vertical, horizontal] = settings.get("place").split("-");
    const left = whole ? box.left : horizontal === "left" ? box.left + margin : box.left + box.width - margin - width;
    const top = whole ? box.top : vertical === "top" ? box.top + margin : box.top + box.height - margin - height;
    Object.assign(this.inset.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` });
    this.inset.dataset.contrast = settings.get("contrast");
    this.inset.dataset.alone = alone;
    this.inset.dataset.place = whole ? "whole" : settings.get("place");
    this.inset.style.setProperty("--backdrop", 0.82 * settings.get("opacity") / 100);
    this.clearBar(whole ? 0 : top + height);
    this.inset.hidden = false;
  }

  /** Tell the style how high the bar of controls is, and how far it would cover the inset. */
  clearBar(insetBottom) {
    const clear = this.root.clientHeight - this.bar.offsetHeight + BAR_FADE * parseFloat(getComputedStyle(this.bar).paddingTop);
    this.root.style.setProperty("--clear", `${this.root.clientHeight - clear}px`);
    this.inset.style.setProperty("--lift", `${Math.min(0, clear - insetBottom)}px`);
  }

  /** Show the keys around the present one: phones above, placement and shape as the paper prints them. */
  showKeys({ keys, now }, words) {
    const line = keys.map((key) => `${key.start}`).join() + now + words.rest;
    if (line === this.shownKeys) return;
    this.shownKeys = line;
    this.keysLine.textContent = "";
    keys.forEach((key, index) => {
      const item = document.createElement("li");
      const phones = document.createElement("b");
      const code = document.createElement("small");
      phones.textContent = key.phones.join("") || "·";
      code.textContent = `${PLACEMENT_NUMBER[key.placement]}${key.shape} ${words[key.placement]}`;
      if (index === now) item.className = "now";
      item.append(phones, code);
      this.keysLine.append(item);
    });
  }

  /** `whose`: what is known of who speaks, `{status, of}`, or null where nobody asked. */
  showStatus(state, words, whose) {
    this.status.dataset.state = state;
    this.status.dataset.whose = whose ? whose.status : "";
    let text = words[state];
    if (whose) text += ` · ${words[whose.status]}${whose.status === "verified" ? ` (${whose.of})` : ""}`;
    if (whose && Math.abs(whose.age_s) >= 1) text += ` · ${Math.round(whose.age_s)} s`;
    if (this.statusText.textContent !== text) this.statusText.textContent = text;
  }

  /** Without a cuer there is no box: the programme is seen whole. */
  showCuer(present) {
    this.inset.classList.toggle("empty", !present);
  }

  /** A word that passes: what a key press did. */
  say(text) {
    this.toast.textContent = text;
    this.toast.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = setTimeout(() => { this.toast.hidden = true; }, 1400);
  }
}
