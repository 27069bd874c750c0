/** The television page: programme, cuer in step with it, controls. */

import { AvatarView, parseAvatar } from "./avatar.js";
import { ProgrammeClock } from "./clock.js";
import { Controls, HELP } from "./controls.js";
import { Feed } from "./feed.js";
import { HandReader } from "./hand.js";
import { LiveProgramme } from "./live.js";
import { VoiceModel } from "./model.js";
import { PointLights } from "./points.js";
import { Settings } from "./settings.js";
import { Stage } from "./stage.js";
import { label, TEXTS } from "./texts.js";
import { Timeline } from "./timeline.js";

const REPORT_MS = 400;
const STEP_S = 0.04;

class Page {
  /** `arrays` of the avatar, or null where there is none; `live`: the programme comes as it is made. */
  constructor(model, arrays, live) {
    this.model = model;
    this.live = live;
    this.quiet = false;
    this.whose = null;
    this.video = /** @type {HTMLVideoElement} */ (document.getElementById("programme"));
    this.timeline = new Timeline(model.movement);
    this.reader = new HandReader(model);
    this.clock = new ProgrammeClock(this.video);
    this.stage = new Stage(document);
    this.points = new PointLights(document.getElementById("points"), model);
    this.avatar = arrays && buildAvatar(document.getElementById("avatar"), model, arrays);
    this.params = new Float64Array(model.layout.length);
    this.markers = new Float64Array(3 * model.markers.length);
    this.link = "connecting";
    this.drawn = { timeS: NaN, nowMs: NaN, visibility: 0 };
    this.scene = "";
    this.settings = new Settings(() => this.apply());
    this.controls = new Controls(document, this);
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

  listen() {
    this.video.addEventListener("seeking", () => this.report(true));
    this.video.addEventListener("error", () => this.stage.say(this.words().failed));
    for (const name of ["loadedmetadata", "resize"]) this.video.addEventListener(name, () => this.apply());
    window.addEventListener("resize", () => this.apply());
    document.addEventListener("visibilitychange", () => { this.scene = ""; });
    setInterval(() => this.report(false), REPORT_MS);
  }

  words() {
    return TEXTS[this.settings.get("language")];
  }

  /** Bring the page in line with the settings. */
  apply() {
    const words = label(document.documentElement, this.settings.get("language"));
    this.stage.arrange(this.settings, this.model.aspect);
    document.getElementById("avatar").hidden = !this.showsAvatar();
    document.getElementById("points").hidden = this.showsAvatar();
    this.stage.keysLine.hidden = !this.settings.get("keys");
    if (!document.getElementById("panel").contains(document.activeElement)) this.showPanel(words);
    this.controls.show();
  }

  showPanel(words) {
    this.settings.show(document.getElementById("choices"), words);
    const help = document.getElementById("help");
    help.textContent = "";
    for (const [key, name, colour] of HELP) {
      const term = document.createElement("dt");
      const text = document.createElement("dd");
      term.textContent = colour ? `${key} · ${words[colour]}` : key;
      text.textContent = words[name];
      help.append(term, text);
    }
  }

  showsAvatar() {
    return this.avatar !== null && this.settings.get("style") === "avatar";
  }

  /** Length of one step: a frame of film. */
  stepS() {
    return STEP_S;
  }

  seekTo(timeS) {
    this.video.currentTime = Math.max(0, Math.min(timeS, this.video.duration || timeS));
  }

  receive(message) {
    this.link = "searching";
    if (message.type === "status") this.timeline.insertState(message);
    else if (message.type === "line") this.quiet = message.quiet;
    else if (message.type === "authenticity") this.whose = message;
    else if (message.type === "keys") this.timeline.insertKeys(message.keys);
  }

  /** Say that the picture was coded anew for the browser, or cannot be shown. */
  tellCodec({ recoded, unseen }) {
    if (recoded) this.stage.say(`${this.words().recoded} (${recoded})`);
    if (unseen) this.stage.say(`${this.words().unseen} (${unseen})`);
  }

  report(jumped) {
    const timeS = this.video.currentTime;
    this.timeline.prune(timeS);
    if (this.live) this.controls.showTime();
    else this.tellPosition(timeS, jumped);
  }

  tellPosition(timeS, jumped) {
    this.feed.position(timeS, jumped && this.timeline.knownFrom(timeS) < 1);
    this.controls.showTime();
  }

  /**
   * The one state that is shown: of reception at `timeS`, or of the connection where nothing was
   * received. A cuer who was received, but of whom nothing is here to be drawn yet, is awaited.
   */
  state(timeS, visibility) {
    if (this.link !== "searching") return this.link;
    if (this.quiet) return "lost";
    const state = this.timeline.stateAt(timeS) || "searching";
    return visibility === 0 && (state === "locked" || state === "degraded") ? "awaiting" : state;
  }

  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    const timeS = this.clock.at(now);
    const visibility = this.timeline.sample(timeS, this.params);
    if (visibility > 0) this.model.reconstruct(this.params, this.markers);
    this.drawn = { timeS, nowMs: now, visibility };
    const look = {
      alpha: visibility * this.settings.get("opacity") / 100,
      mirror: this.settings.get("mirror"),
      handOnly: this.settings.get("handOnly"),
      contrast: this.settings.get("contrast"),
      dot: 0.62 * this.settings.get("dot") / 100,
    };
    this.draw(timeS, look);
    const words = this.words();
    this.stage.showStatus(this.state(timeS, visibility), words, this.whose);
    this.stage.showCuer(visibility > 0);
    const hand = visibility > 0 ? this.reader.read(this.markers) : null;
    this.stage.showKeys(this.timeline.keysAround(timeS, 2, 2, hand), words);
  }

  /** Draw the cuer, unless she stands there as she is: a programme that rests costs nothing. */
  draw(timeS, look) {
    const view = this.showsAvatar() ? this.avatar : this.points;
    const { clientWidth, clientHeight, id } = view.canvas;
    const size = [clientWidth, clientHeight, window.devicePixelRatio];
    const scene = [id, timeS, ...size, ...Object.values(look), ...this.params].join();
    if (scene === this.scene) return;
    this.scene = scene;
    if (this.showsAvatar()) this.avatar.draw(timeS, look);
    else this.points.draw(this.markers, look);
  }
}

/** The avatar's view, or null where the television has no WebGL: points are enough. */
function buildAvatar(canvas, model, arrays) {
  try {
    return new AvatarView(canvas, model, arrays);
  } catch (error) {
    console.warn(`no avatar: ${error.message}`);
    return null;
  }
}

async function start() {
  const [voice, avatar, status] = await Promise.all(["/voice.json", "/avatar.bin", "/status.json"].map((path) => fetch(path)));
  const arrays = avatar.ok ? parseAvatar(await avatar.arrayBuffer()) : null;
  Object.assign(window, { cuecast: new Page(new VoiceModel(await voice.json()), arrays, (await status.json()).live) });
}

start();
