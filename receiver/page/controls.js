/** Buttons, keyboard and remote control: every way to the same commands. */

import { navigate } from "./focus.js";

const SPEEDS = [0.25, 0.5, 0.75, 1, 1.25, 1.5, 2];
const QUIET_MS = 3000;

/** @type {Words} */
const BY_KEY = {
  " ": "play", Enter: "play", k: "play", MediaPlayPause: "play", MediaPlay: "play", MediaPause: "play",
  ArrowLeft: "rewind", ArrowRight: "wind", MediaRewind: "rewind", MediaFastForward: "wind",
  ",": "stepBack", ".": "stepForward", "[": "slower", "]": "faster", "-": "slower", "+": "faster",
  a: "style", h: "handOnly", p: "place", s: "size", m: "mirror", c: "keys", l: "language", f: "full",
  t: "captions", ClosedCaptionToggle: "captions", Subtitle: "captions", b: "layout",
  MediaTrackPrevious: "stepBack", MediaTrackNext: "stepForward", MediaStop: "pause",
  "?": "settings", r: "settings", Info: "settings", Escape: "close", GoBack: "close", BrowserBack: "close",
  ColorF0Red: "handOnly", ColorF1Green: "style", ColorF2Yellow: "place", ColorF3Blue: "size",
};
/** Key codes of televisions whose browsers name no keys (CE-HTML, HbbTV). @type {Record<number, string>} */
const BY_CODE = {
  415: "play", 19: "play", 413: "pause", 412: "rewind", 417: "wind", 460: "captions",
  403: "handOnly", 404: "style", 405: "place", 406: "size", 461: "close", 457: "settings",
};
/** Sizes of the captions that one key steps through, percent of the screen's smaller side. */
const LETTERS = [0, 4, 6, 8];
/** Keys, the text that explains them, and the coloured key of a remote control that does the same. */
export const HELP = [
  ["␣", "help-play"], ["← →", "help-seek"], [", .", "help-step"], ["[ ]", "help-speed"],
  ["A", "help-style", "green"], ["H", "help-hand", "red"], ["P", "help-place", "yellow"], ["S", "help-size", "blue"],
  ["▲ ▼ OK", "help-focus"], ["B", "help-layout"], ["T", "help-captions"], ["M", "help-mirror"], ["C", "help-keys"], ["F", "help-full"], ["L", "help-language"], ["? · R", "help-settings"],
];

export class Controls {
  /** `page`: {video, settings, stage, cuer, words(), stepS(), seekTo(timeS)}. @param {Document} document @param {any} page */
  constructor(document, page) {
    this.document = document;
    this.page = page;
    this.video = page.video;
    this.stage = page.stage;
    this.bind();
    this.wake();
  }

  /** @param {string} id */
  find(id) {
    return /** @type {any} */ (this.document.getElementById(id));
  }

  bind() {
    const { video, document } = this;
    /** @type {Words} */
    const buttons = {
      play: "play", back: "stepBack", forward: "stepForward", speed: "faster", style: "style",
      "hand-only": "handOnly", settings: "settings", full: "full",
    };
    for (const id of Object.keys(buttons)) this.find(id).onclick = () => this.run(buttons[id]);
    this.find("seek").oninput = (/** @type {any} */ event) => this.page.seekTo(event.target.value / 1000 * (video.duration || 0));
    document.addEventListener("keydown", (event) => this.key(event));
    for (const name of ["pointermove", "pointerdown", "keydown", "focusin"]) {
      document.addEventListener(name, () => this.wake());
    }
    video.addEventListener("click", () => this.run("play"));
    for (const name of ["play", "pause", "ratechange", "durationchange"]) video.addEventListener(name, () => this.show());
    this.bindSession();
  }

  /** Follow the keys of keyboards and headsets which the system handles before the page. */
  bindSession() {
    const commands = { play: "play", pause: "pause", stop: "pause", seekbackward: "rewind", seekforward: "wind" };
    for (const [action, command] of Object.entries(commands)) {
      navigator.mediaSession?.setActionHandler(/** @type {MediaSessionAction} */ (action), () => this.run(command));
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (navigate(this.document, event)) {
      event.preventDefault();
      return;
    }
    const target = /** @type {HTMLElement} */ (event.target);
    const command = BY_KEY[event.key] || BY_KEY[event.key.toLowerCase()] || BY_CODE[event.keyCode];
    const typing = /^(SELECT|INPUT)$/.test(target.tagName) && command !== "close";
    const pressing = target.tagName === "BUTTON" && (event.key === " " || event.key === "Enter");
    if (!command || typing || pressing) return;
    event.preventDefault();
    this.run(command);
  }

  /** @param {string} command */
  run(command) {
    const { settings } = this.page;
    if (["style", "place", "size", "layout", "language"].includes(command)) {
      settings.next(command);
      if (command !== "language") this.stage.say(this.page.words()[settings.get(command)]);
    } else if (["handOnly", "mirror", "keys"].includes(command)) settings.toggle(command);
    else /** @type {any} */ (this)[command]();
    this.show();
  }

  play() {
    if (!this.video.paused) this.video.pause();
    else this.video.play().catch(() => this.stage.say(this.page.words().failed));
  }

  pause() {
    this.video.pause();
  }

  captions() {
    const { settings } = this.page;
    settings.set("captions", LETTERS.find((size) => size > settings.get("captions")) || 0);
    this.stage.say(`${this.page.words().captions} : ${settings.get("captions")} %`);
  }

  rewind() {
    this.page.seekTo(this.video.currentTime - 5);
  }

  wind() {
    this.page.seekTo(this.video.currentTime + 5);
  }

  stepBack() {
    this.video.pause();
    this.page.seekTo(this.video.currentTime - this.page.stepS());
  }

  stepForward() {
    this.video.pause();
    this.page.seekTo(this.video.currentTime + this.page.stepS());
  }

  slower() {
    this.changeSpeed(-1);
  }

  /** The next speed; from the fastest on to the slowest, so that one button reaches all. */
  faster() {
    this.changeSpeed(1);
  }

  /** @param {number} direction */
  changeSpeed(direction) {
    const at = SPEEDS.indexOf(this.video.playbackRate) + direction + SPEEDS.length;
    this.video.playbackRate = SPEEDS[at % SPEEDS.length];
    this.stage.say(`${this.video.playbackRate}×`);
  }

  settings() {
    this.openPanel(this.find("panel").hidden);
  }

  /** Leave the panel, then the bar. */
  close() {
    if (this.find("panel").hidden && this.find("bar").contains(this.document.activeElement)) {
      /** @type {HTMLElement} */ (this.document.activeElement).blur();
    }
    this.openPanel(false);
  }

  /** @param {boolean} open */
  openPanel(open) {
    this.find("panel").hidden = !open;
    this.wake();
    this.find("settings").setAttribute("aria-expanded", open);
    if (open) this.find("panel").querySelector("select").focus();
    else if (this.find("panel").contains(this.document.activeElement)) this.find("settings").focus();
  }

  full() {
    if (this.document.fullscreenElement) this.document.exitFullscreen();
    else this.stage.root.requestFullscreen().catch((/** @type {Error} */ error) => this.stage.say(error.message));
  }

  /** Show the controls; they leave after a while of playing without a touch. */
  wake() {
    this.stage.root.classList.remove("quiet");
    clearTimeout(this.quietTimer);
    this.quietTimer = setTimeout(() => {
      const busy = this.video.paused || !this.find("panel").hidden;
      this.stage.root.classList.toggle("quiet", !busy);
    }, QUIET_MS);
  }

  /** Bring buttons, clock and slider up to date. */
  show() {
    const { video } = this;
    const { settings } = this.page;
    const text = this.page.words();
    /** @param {string} id @param {string} shown @param {string} [full] */
    const name = (id, shown, full) => {
      this.find(id).textContent = shown;
      this.find(id).setAttribute("aria-label", full || shown);
    };
    name("play", video.paused ? text.play : text.pause);
    this.find("play").dataset.paused = video.paused;
    name("speed", `${video.playbackRate}×`, `${text.speed} ${video.playbackRate}×`);
    const style = text[settings.get("style")];
    name("style", style, `${text.style} : ${style}`);
    this.find("style").hidden = !this.page.cuer.avatar;
    name("hand-only", text.handOnly);
    this.find("hand-only").setAttribute("aria-pressed", settings.get("handOnly"));
    name("settings", text.settings);
    this.showTime();
  }

  showTime() {
    const { video } = this;
    const duration = Number.isFinite(video.duration) ? video.duration : 0;
    this.find("clock").textContent = duration ? `${minutes(video.currentTime)} / ${minutes(duration)}` : minutes(video.currentTime);
    const seek = this.find("seek");
    seek.hidden = !duration;
    if (duration && this.document.activeElement !== seek) seek.value = 1000 * video.currentTime / duration;
    seek.setAttribute("aria-valuetext", minutes(video.currentTime));
  }
}

/** @param {number} seconds */
function minutes(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
