/** The stage: everything at its place, the line of keys, the state of reception. */

import { PLACEMENT_NUMBER } from "./keys.js";
import { layoutOf } from "./layout.js";

const SAID_MS = 1400;

export class Stage {
  /**
   * `document`: a document or shadow tree with the elements of `index.html`; some may be missing.
   * @param {DocumentOrShadowRoot & NonElementParentNode} document
   */
  constructor(document) {
    /** @param {string} id */
    const find = (id) => /** @type {any} */ (document.getElementById(id));
    this.root = find("stage");
    this.programme = find("programme");
    this.video = this.programme;
    this.inset = find("inset");
    this.bar = find("bar");
    this.panel = find("panel");
    this.captions = find("captions");
    this.keysLine = find("keys");
    this.status = find("status");
    this.statusText = find("status-text");
    this.statusMore = find("status-more");
    this.toast = find("toast");
    this.around = 2;
    this.shownKeys = "";
    /** @type {any} The last `Layout`, there once the stage was arranged. */
    this.layout = null;
  }

  /** Where a page put the programme inside the stage, letterboxed; null where the stage places it itself. */
  picture() {
    const { videoWidth, videoHeight } = this.video;
    if (this.programme || !videoWidth) return null;
    const stage = this.root.getBoundingClientRect();
    const { left, top, width, height } = this.video.getBoundingClientRect();
    const ratio = videoWidth / videoHeight;
    const shown = Math.min(width, height * ratio);
    return {
      left: left - stage.left + (width - shown) / 2,
      top: top - stage.top + (height - shown / ratio) / 2,
      width: shown,
      height: shown / ratio,
    };
  }

  /**
   * Put everything in its place; `choice` as `layoutOf` takes it, with `contrast` and `opacity`.
   * @param {StageChoice} choice @param {number} aspect
   */
  arrange(choice, aspect) {
    const { videoWidth, videoHeight, readyState } = this.video;
    const screen = { width: this.root.clientWidth, height: this.root.clientHeight };
    const ratio = videoWidth ? videoWidth / videoHeight : readyState > 0 ? 0 : 16 / 9;
    const layout = layoutOf(screen, this.picture(), ratio, aspect, choice);
    this.layout = layout;
    this.root.dataset.kind = layout.kind;
    if (this.programme) lay(this.programme, layout.programme);
    lay(this.inset, layout.cuer);
    this.inset.dataset.contrast = choice.contrast;
    this.inset.dataset.movable = Boolean(this.programme) && layout.kind === "over";
    this.inset.style.setProperty("--backdrop", 0.82 * choice.opacity / 100);
    lay(this.keysLine, layout.keys);
    this.keysLine.style.fontSize = `${layout.keys.size}px`;
    this.around = layout.keys.around;
    this.keysLine.hidden = !choice.keys;
    this.arrangeText(choice, layout);
    this.inset.hidden = false;
  }

  /** @param {StageChoice} choice @param {Layout} layout */
  arrangeText({ captions, ground, keys: shown }, { captions: band, keys, programme, bar, panel, kind }) {
    // The word on reception takes the picture's upper left corner, 176 by 40 pixels, or stands below the keys.
    const beside = keys.top > programme.top + 40 || keys.left > programme.left + 176;
    const top = shown && !beside ? keys.top + keys.height : programme.top;
    Object.assign(this.status.style, { left: `${programme.left + 8}px`, top: `${top + 8}px`, maxWidth: `${programme.width - 16}px` });
    if (this.captions) {
      lay(this.captions, band);
      this.captions.hidden = !captions;
      this.captions.dataset.ground = ground;
      this.captions.style.fontSize = `${band.height / 2.9}px`;
    }
    if (this.panel) {
      Object.assign(this.panel.style, {
        left: `${panel.left + 8}px`, top: `${panel.top + 8}px`,
        width: `${Math.min(panel.width - 16, 608)}px`, maxHeight: `${panel.height - 16}px`,
      });
    }
    if (!this.programme) return;
    Object.assign(this.bar.style, { left: `${bar.left}px`, width: `${bar.width}px`, top: "auto", bottom: "0" });
    if (kind === "below") Object.assign(this.bar.style, { bottom: `${this.root.clientHeight - bar.height}px` });
    this.clearBar();
  }

  /** Tell the style how far what stands in the bar's way has to rise while the bar is shown. */
  clearBar() {
    const bar = { left: this.bar.offsetLeft, top: this.bar.offsetTop, width: this.bar.offsetWidth, height: this.bar.offsetHeight };
    /** @param {Box} box */
    const rise = ({ left, top, width, height }) => {
      const beside = left >= bar.left + bar.width - 1 || left + width <= bar.left + 1 || this.layout.kind === "below";
      return beside ? 0 : Math.max(0, Math.min(top + height - bar.top, top));
    };
    const { cuer, keys, captions, kind } = this.layout;
    const text = Math.max(rise(keys), rise(captions));
    /** @param {HTMLElement|null} part @param {number} pixels */
    const raise = (part, pixels) => part?.style.setProperty("--lift", `${-pixels}px`);
    raise(this.inset, rise(cuer));
    raise(this.keysLine, kind === "over" ? text : rise(keys));
    raise(this.captions, text);
  }

  /**
   * Show the keys around the present one: phones above, placement and shape as the paper prints them.
   * @param {{keys: Key[], now: number}} shown @param {Words} words
   */
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
      if (index === now) {
        item.className = "now";
        item.setAttribute("aria-current", "true");
      }
      item.append(phones, code);
      this.keysLine.append(item);
    });
  }

  /**
   * `whose`: what is known of who speaks, `{status, of}`, or null where nobody asked; `more` changes too often to be read aloud.
   * @param {string} state @param {Words} words @param {Whose|null} whose @param {string} [more]
   */
  showStatus(state, words, whose, more = "") {
    this.status.dataset.state = state;
    this.status.dataset.whose = whose ? whose.status : "";
    let text = words[state];
    if (whose) text += ` · ${words[whose.status]}${whose.status === "verified" ? ` (${whose.of})` : ""}`;
    const ageS = whose?.age_s ?? 0;
    if (Math.abs(ageS) >= 1) text += ` · ${Math.round(ageS)} s`;
    if (this.statusText.textContent !== text) this.statusText.textContent = text;
    if (this.statusMore && this.statusMore.textContent !== more) this.statusMore.textContent = more;
  }

  /** Without a cuer there is no box: the programme is seen whole. @param {boolean} present */
  showCuer(present) {
    this.inset.classList.toggle("empty", !present);
  }

  /** A word that passes: what a key press did. @param {string} text */
  say(text) {
    this.toast.textContent = text;
    this.toast.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = setTimeout(() => { this.toast.hidden = true; }, SAID_MS);
  }
}

/** @param {HTMLElement} element @param {Box} box */
function lay(element, { left, top, width, height }) {
  Object.assign(element.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` });
}
