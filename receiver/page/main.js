/** The television page: programme, cuer in step with it, controls. */

import { parseAvatar } from "./avatar.js";
import { Captions } from "./captions.js";
import { ProgrammeClock } from "./clock.js";
import { Controls, HELP } from "./controls.js";
import { Cuer } from "./cuer.js";
import { Feed } from "./feed.js";
import { LiveProgramme } from "./live.js";
import { VoiceModel } from "./model.js";
import { Moving } from "./moving.js";
import { Settings } from "./settings.js";
import { Stage } from "./stage.js";
import { label, TEXTS } from "./texts.js";

const REPORT_MS = 400;
const STEP_S = 0.04;

/** So much of a programme without a cuer is enough to say that it has none, seconds. */
const ABSENT_S = 10;

class Page {
  /**
   * `arrays` of the avatar, or null where there is none; `status`: {live, captions} of the television.
   * @param {VoiceModel} model @param {Arrays|null} arrays @param {{live: boolean, captions: string}} status
   */
  constructor(model, arrays, { live, captions }) {
    this.model = model;
    this.live = live;
    this.quiet = false;
    this.whose = null;
    /** Whether the programme has no cuer, and all of the screen. */
    this.absent = false;
    this.heard = { fromS: 0, untilS: 0 };
    /** @param {string} id */
    const find = (id) => /** @type {any} */ (document.getElementById(id));
    this.video = /** @type {HTMLVideoElement} */ (find("programme"));
    this.cuer = new Cuer(model, arrays, { points: find("points"), avatar: find("avatar") });
    this.timeline = this.cuer.timeline;
    this.clock = new ProgrammeClock(this.video);
    this.stage = new Stage(document);
    this.link = "connecting";
    this.drawn = { timeS: NaN, nowMs: NaN, visibility: 0 };
    this.settings = new Settings(() => this.apply());
    if (!this.cuer.avatar) this.settings.withhold("style");
    if (!this.cuer.avatar || model.looks.length < 2) this.settings.withhold("appearance");
    if (captions) this.addCaptions(captions);
    this.captions = new Captions(this.video, find("captions"));
    this.controls = new Controls(document, this);
    this.moving = new Moving(this.stage, this.settings);
    this.feed = new Feed(`ws://${location.host}/feed`, {
      open: () => {
        if (this.link !== "crowded") this.link = "searching";
        this.report(true);
      },
      closed: (full) => { this.link = full ? "crowded" : "offline"; },
      message: (message) => this.receive(message),
      motion: (piece) => this.timeline.insert(piece),
    });
    this.listen();
    this.apply();
    if (live) this.programme = new LiveProgramme(this.video, `ws://${location.host}/media`, (beginning) => this.tellCodec(beginning));
    else this.video.src = "/programme";
    requestAnimationFrame((now) => this.tick(now));
  }

  /** The programme's text, in a language. @param {string} language */
  addCaptions(language) {
    const track = document.createElement("track");
    Object.assign(track, { kind: "captions", src: "/captions.vtt", srclang: language, label: language });
    this.video.append(track);
  }

  listen() {
    this.video.addEventListener("seeking", () => this.report(true));
    this.video.addEventListener("error", () => this.stage.say(this.words().failed));
    for (const name of ["loadedmetadata", "resize"]) this.video.addEventListener(name, () => this.apply());
    window.addEventListener("resize", () => this.apply());
    document.addEventListener("visibilitychange", () => this.cuer.forget());
    setInterval(() => this.report(false), REPORT_MS);
  }

  words() {
    return TEXTS[this.settings.get("language")];
  }

  /** Bring the page in line with the settings. */
  apply() {
    const words = label(document.documentElement, this.settings.get("language"));
    const { values } = this.settings;
    const captions = this.captions.present ? values.captions : 0;
    const absent = this.absent ? { layout: "over", size: "small" } : {};
    this.stage.arrange({ .../** @type {StageChoice} */ (values), captions, ...absent }, this.model.aspect);
    this.cuer.choose(values.style);
    this.cuer.dress(values.appearance, location.href).catch((error) => console.warn(`cuecast: ${error.message}`));
    this.showPanel(words);
    this.controls.show();
  }

  /** @param {Words} words */
  showPanel(words) {
    this.settings.show(/** @type {HTMLElement} */ (document.getElementById("choices")), words);
    const help = /** @type {HTMLElement} */ (document.getElementById("help"));
    help.textContent = "";
    for (const [key, name, colour] of HELP) {
      const term = document.createElement("dt");
      const text = document.createElement("dd");
      term.textContent = colour ? `${key} · ${words[colour]}` : key;
      text.textContent = words[name];
      help.append(term, text);
    }
  }

  /** Length of one step: a frame of film. */
  stepS() {
    return STEP_S;
  }

  /** @param {number} timeS */
  seekTo(timeS) {
    this.video.currentTime = Math.max(0, Math.min(timeS, this.video.duration || timeS));
  }

  /** @param {any} message */
  receive(message) {
    this.link = "searching";
    if (message.type === "status") this.timeline.insertState(message);
    else if (message.type === "heard") this.heard = { fromS: message.from_s, untilS: message.until_s };
    else if (message.type === "line") this.quiet = message.quiet;
    else if (message.type === "authenticity") this.whose = message;
    else if (message.type === "keys") this.timeline.insertKeys(message.keys);
    else if (message.type === "captions") {
      const { present } = this.captions;
      this.captions.insert(message, this.words().captions);
      if (!present) this.apply();
    }
  }

  /** Say that the picture was coded anew for the browser, or cannot be shown. @param {{recoded: string, unseen: string}} beginning */
  tellCodec({ recoded, unseen }) {
    if (recoded) this.stage.say(`${this.words().recoded} (${recoded})`);
    if (unseen) this.stage.say(`${this.words().unseen} (${unseen})`);
  }

  /** @param {boolean} jumped */
  report(jumped) {
    const timeS = this.video.currentTime;
    this.timeline.prune(timeS);
    if (this.live && !this.heard.untilS && timeS > 0) this.heard = { fromS: timeS, untilS: timeS };
    if (!this.live) this.feed.position(timeS, jumped && this.timeline.knownFrom(timeS) < 1);
    this.controls.showTime();
  }

  /**
   * The one state that is shown: of reception at `timeS`, or of the connection where nothing was
   * received. A cuer who was received, but of whom nothing is here to be drawn yet, is awaited; one
   * who was not found for some time is absent.
   * @param {number} timeS @param {number} visibility
   */
  state(timeS, visibility) {
    if (this.link !== "searching") return this.link;
    if (this.quiet) return "lost";
    const state = this.timeline.stateAt(timeS) || "searching";
    if (state === "searching" && this.searchedS(timeS) >= ABSENT_S) return "absent";
    return visibility === 0 && (state === "locked" || state === "degraded") ? "awaiting" : state;
  }

  /** Seconds of the programme that were searched for a cuer, up to what was received. @param {number} timeS */
  searchedS(timeS) {
    const { fromS, untilS } = this.heard;
    if (this.timeline.states.some(({ time_s, state }) => state === "locked" && time_s <= untilS)) return 0;
    return Math.max(this.live ? timeS : untilS, untilS) - fromS;
  }

  /** @param {number} now */
  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    const timeS = this.clock.at(now);
    const shownS = this.shownS = timeS - this.settings.get("delay") / 1000;
    const visibility = this.cuer.show(shownS, /** @type {LookChoice} */ (this.settings.values));
    this.drawn = { timeS, nowMs: now, visibility };
    this.captions.showAt(timeS);
    const words = this.words();
    const state = this.state(timeS, visibility);
    if ((state === "absent") !== this.absent) {
      this.absent = !this.absent;
      this.apply();
    }
    const more = state === "absent" ? `${words.searched} ${Math.round(this.searchedS(timeS))} s` : "";
    this.stage.showStatus(state, words, this.whose, more);
    this.stage.showCuer(visibility > 0);
    this.stage.showKeys(this.cuer.keysAround(shownS, this.stage.around, this.stage.around), words);
  }
}

async function start() {
  const [voice, avatar, status] = await Promise.all(["/voice.json", "/avatar.bin", "/status.json"].map((path) => fetch(path)));
  const arrays = avatar.ok ? parseAvatar(await avatar.arrayBuffer()) : null;
  Object.assign(window, { cuecast: new Page(new VoiceModel(await voice.json()), arrays, await status.json()) });
}

start();
