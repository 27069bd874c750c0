/**
 * `<cuecast-player>`: draws the cuer over the `<video>` or `<audio>` inside it.
 *
 *     <script type="module" src="cuecast-player.js"></script>
 *     <cuecast-player><video src="programme.mp4" controls></video></cuecast-player>
 */

import { parseAvatar } from "../../page/avatar.js";
import { ProgrammeClock } from "../../page/clock.js";
import { Cuer } from "../../page/cuer.js";
import { VoiceModel } from "../../page/model.js";
import { Stage } from "../../page/stage.js";
import { TEXTS } from "../../page/texts.js";
import { Hearing, obstacle } from "./hearing.js";
import { REASONS } from "./reasons.js";
import { Sidecar, sidecarAddress } from "./sidecar.js";
import { STYLE } from "./style.js";

const BODY = `<div id="stage" class="stage quiet" part="stage"><slot></slot>
<div id="inset" class="inset empty" part="inset"><canvas id="points" class="layer" role="img" part="cuer"></canvas>
<canvas id="avatar" class="layer" role="img" part="cuer" hidden></canvas></div>
<p id="status" class="status" part="status"><span class="lamp" aria-hidden="true"></span><span id="status-text" role="status"></span></p>
<ol id="keys" class="keys" part="keys" hidden></ol></div>`;

/** What stands in an attribute, with what holds without it; a flag is there or not. */
const CHOICES = /** @type {Words} */ ({
  look: "avatar", appearance: "woman", place: "bottom-right", size: "medium", contrast: "panel", opacity: "100",
});
/** @type {Words} */
const FLAGS = { keys: "keys", mirror: "mirror", handOnly: "hand-only" };
/** Reasons for which the stream file beside the programme is looked for. */
const DEAF = new Set(["other-origin", "insecure", "no-worklet", "asleep", "muted", "speed", "silence", "no-mark"]);
const PRUNE_MS = 5000;
/** How far the arrival of a broadcast's cues may be from their time on air, seconds (E25). */
const TOLERANCE_S = 10;

/** Data of the player by folder, fetched once a page. */
const loaded = new Map();

/** @param {string} base */
async function load(base) {
  /** @param {string} name @param {boolean} [needed] */
  const get = async (name, needed = true) => {
    const answer = await fetch(new URL(name, base));
    if (!answer.ok && needed) throw new Error(`${name}: ${answer.status}`);
    return answer.ok ? answer.arrayBuffer() : null;
  };
  const [module, voice, document, avatar] = await Promise.all(
    [get("cuecast.wasm"), get("voice.bin"), get("voice.json"), get("avatar.bin", false)],
  );
  return { module, voice, document: JSON.parse(new TextDecoder().decode(/** @type {ArrayBuffer} */ (document))), arrays: avatar && parseAvatar(avatar) };
}

export class CuecastPlayer extends HTMLElement {
  /** @type {any} There once the files are. */
  cuer;
  /** @type {any} */
  model;
  /** @type {any} */
  clock;
  refresh = 0;
  pruning = 0;
  /** @type {HTMLMediaElement | null} The programme that is being drawn over. */
  opened = null;
  /** @type {any} Status of its proofs, if the page asked whose it is. */
  whose = null;

  static observedAttributes = [...Object.keys(CHOICES), ...Object.values(FLAGS), "lang", "avatar"];

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    // Not a <style>: a site's policy may forbid those (style-src without 'unsafe-inline').
    const style = new CSSStyleSheet();
    style.replaceSync(STYLE);
    root.adoptedStyleSheets = [style];
    const body = document.createElement("template");
    body.innerHTML = BODY;
    root.append(body.content);
    this.stage = new Stage(root);
    this.reception = "searching";
    this.reason = "";
    this.serial = 0;
    this.programme = 0;
    const slot = /** @type {HTMLSlotElement} */ (root.querySelector("slot"));
    slot.addEventListener("slotchange", () => { if (this.isConnected) this.open(); });
  }

  /** Folder of the player's files. */
  get base() {
    return new URL(this.getAttribute("base") || ".", this.hasAttribute("base") ? document.baseURI : import.meta.url).href;
  }

  set base(address) {
    this.setAttribute("base", address);
  }

  get media() {
    return /** @type {HTMLMediaElement | null} */ (this.querySelector("video, audio"));
  }

  /** Keys known so far around the present time: {start, end, shape, placement, phones}, media seconds. */
  get keyList() {
    return this.cuer ? [...this.cuer.timeline.keys] : [];
  }

  get timeline() {
    return this.cuer.timeline;
  }

  connectedCallback() {
    this.open();
  }

  disconnectedCallback() {
    this.serial += 1;
    this.deafen();
    this.attached?.abort();
    this.opened = null;
    cancelAnimationFrame(this.refresh);
    clearInterval(this.pruning);
    this.sizes?.disconnect();
  }

  attributeChangedCallback() {
    if (this.model) this.arrange();
  }

  /** The attributes by the television's names for settings. */
  get choice() {
    /** @type {any} */
    const choice = { layout: "over", captions: 0, dot: 100 };
    for (const name of Object.keys(CHOICES)) choice[name] = this.getAttribute(name) || CHOICES[name];
    for (const name of Object.keys(FLAGS)) choice[name] = this.hasAttribute(FLAGS[name]);
    return { ...choice, opacity: Number(choice.opacity) };
  }

  words() {
    return TEXTS[(this.lang || document.documentElement.lang || "en").slice(0, 2)] || TEXTS.en;
  }

  async open() {
    const { media } = this;
    if (media && this.opened === media) return;
    this.disconnectedCallback();
    const serial = this.serial;
    this.opened = media;
    if (!media) return this.because(obstacle(media));
    this.stage.video = media;
    try {
      if (!loaded.has(this.base)) loaded.set(this.base, load(this.base));
      const data = await loaded.get(this.base);
      const trust = await this.announcement();
      if (serial === this.serial) this.start(media, data, trust);
    } catch (error) {
      loaded.delete(this.base);
      this.because(error.reason || "no-files", error.message);
    }
  }

  /** The broadcaster's public file that the attribute `trust` names, and how late his cues may be. */
  async announcement() {
    const address = this.getAttribute("trust");
    if (!address) return {};
    const answer = await fetch(new URL(address, document.baseURI)).catch(() => null);
    if (!answer?.ok) throw Object.assign(new Error(`${address}: ${answer?.status ?? "no answer"}`), { reason: "no-key" });
    return { announcement: await answer.arrayBuffer(), toleranceS: Number(this.getAttribute("tolerance")) || TOLERANCE_S };
  }

  /** @param {HTMLMediaElement} media @param {any} data @param {any} trust */
  start(media, data, trust) {
    this.whose = trust.announcement ? { status: "unknown", of: "" } : null;
    const { module, voice, document, arrays } = data;
    if (this.data !== data) {
      const root = /** @type {ShadowRoot} */ (this.shadowRoot);
      /** @param {string} id */
      const find = (id) => /** @type {any} */ (root.getElementById(id));
      this.model = new VoiceModel(document);
      this.cuer = new Cuer(this.model, arrays, { points: find("points"), avatar: find("avatar") });
      this.data = data;
    }
    this.timeline.clear();
    this.clock = new ProgrammeClock(/** @type {HTMLVideoElement} */ (media));
    this.files = { module, voice, trust, worklet: new URL("worklet.js", this.base), worker: new URL("worker.js", this.base) };
    /** @type {HearingHandlers} */
    this.handlers = {
      heard: (message, offsetS) => this.take(message, offsetS),
      reason: (name, text) => (DEAF.has(name) ? this.lookBeside(name) : this.because(name, text)),
    };
    this.listen();
    this.sizes = new ResizeObserver(() => this.arrange());
    for (const part of [this, media]) this.sizes.observe(part);
    this.attached = new AbortController();
    const { signal } = this.attached;
    for (const name of ["loadedmetadata", "resize"]) media.addEventListener(name, () => this.arrange(), { signal });
    media.addEventListener("emptied", () => this.timeline.clear(), { signal });
    media.addEventListener("loadstart", () => this.listen(), { signal });
    this.pruning = setInterval(() => this.timeline.prune(media.currentTime), PRUNE_MS);
    this.arrange();
    this.refresh = requestAnimationFrame((now) => this.tick(now));
  }

  /** Begin with a programme: read the stream file named for it, or hear it. */
  listen() {
    this.deafen();
    this.programme += 1;
    this.triedBeside = false;
    this.because("");
    this.tellState("searching");
    if (this.hasAttribute("cue")) this.lookBeside("no-file");
    else this.hearing = new Hearing(/** @type {HTMLMediaElement} */ (this.media), /** @type {PlayerFiles} */ (this.files), this.handlers);
  }

  deafen() {
    this.hearing?.close();
    this.sidecar?.close();
    this.hearing = this.sidecar = null;
  }

  /** Take the stream file beside the programme, if there is one; else say why there is no cuer. @param {string} reason */
  async lookBeside(reason) {
    if (this.triedBeside) return this.because(this.sidecar ? "" : reason);
    this.triedBeside = true;
    const { programme, serial } = this;
    const media = /** @type {HTMLMediaElement} */ (this.media);
    const isPresent = () => programme === this.programme && serial === this.serial;
    const named = this.getAttribute("cue");
    try {
      const sidecar = await Sidecar.open(media, sidecarAddress(media, named), /** @type {PlayerFiles} */ (this.files), /** @type {HearingHandlers} */ (this.handlers));
      if (!isPresent()) return sidecar.close();
      this.deafen();
      this.sidecar = sidecar;
      this.because("");
      this.tellState("locked");
    } catch (error) {
      if (isPresent()) this.because(reason, named ? error.message : "");
    }
  }

  /** Bring the layout in line with attributes and size. */
  arrange() {
    const sound = this.stage.video.readyState > 0 && !this.stage.video.videoWidth;
    this.stage.root.classList.toggle("sound", sound);
    const { choice } = this;
    this.stage.arrange(choice, this.model.aspect);
    this.cuer.choose(choice.look);
    const own = this.getAttribute("avatar");
    const address = own ? new URL(own, document.baseURI).href : "";
    this.cuer.dress(choice.appearance, this.base, address).catch((/** @type {Error} */ error) => this.because("no-files", error.message));
    for (const canvas of Object.values(this.cuer.canvases)) canvas.setAttribute("aria-label", this.words().cuer);
  }

  /** Take what was heard; `offsetS` leads from the audio context's time to the media's. @param {any} message @param {number} offsetS */
  take({ events, pieces, diagnosis }, offsetS) {
    this.diagnosis = diagnosis ?? undefined;
    for (const piece of pieces) this.timeline.insert({ ...piece, startS: piece.startS + offsetS });
    for (const event of events) {
      const timeS = event.timeS + offsetS;
      if (event.kind === "key") this.takeKey(event, timeS);
      else if (event.kind === "state") this.tellState(event.state);
      else if (event.kind === "lost") this.tell("lost", { time: timeS, count: event.count });
      else if (event.kind === "proof") this.takeProof(event, timeS);
    }
  }

  /** @param {any} event @param {number} start */
  takeKey({ durationS, shape, placement, phones, final }, start) {
    const key = { start, end: start + durationS, shape, placement, phones };
    const { timeline } = this;
    /** @param {Key} known */
    const covers = (known) => Math.min(known.end, key.end) - Math.max(known.start, key.start) > 0.5 * (known.end - known.start);
    timeline.keys = timeline.keys.filter((/** @type {Key} */ known) => Math.abs(known.start - start) > 0.01 && !covers(known));
    if (durationS > 0) timeline.insertKeys([key]);
    if (final && durationS > 0) this.tell("key", key);
  }

  /** @param {any} event @param {number} timeS */
  takeProof(event, timeS) {
    if (!(timeS < this.whose?.timeS)) this.whose = { status: event.status, of: event.of.slice(0, 8), age_s: event.ageS, timeS };
    if (event.status === "verified") this.tell("verified", { time: timeS, of: event.of });
  }

  /** @param {string} state */
  tellState(state) {
    if (state === this.reception) return;
    this.reception = state;
    this.tell("state", { state, reason: this.reason, text: "" });
  }

  /** Say why there is no cuer; an empty name takes it back. @param {string} reason @param {string} [detail] */
  because(reason, detail = "") {
    if (reason === this.reason) return;
    this.reason = reason;
    if (detail) console.warn(`cuecast: ${reason}: ${detail}`);
    this.tell("state", { state: reason ? "deaf" : this.reception, reason, text: this.reasonText() });
    if (!this.hearing && !this.sidecar) this.showState(0);
  }

  reasonText() {
    const language = this.words() === TEXTS.fr ? "fr" : "en";
    return this.reason ? REASONS[this.reason][language] : "";
  }

  /** @param {string} name @param {any} detail */
  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  /** @param {number} visibility */
  showState(visibility) {
    const words = { ...this.words(), deaf: this.reasonText() };
    const received = this.reception === "locked" || this.reception === "degraded";
    const state = this.reason ? "deaf" : received && visibility === 0 ? "awaiting" : this.reception;
    this.stage.showStatus(state, words, this.whose || null);
    this.stage.status.hidden = !this.reason && this.media?.paused === true && visibility === 0;
  }

  /** @param {number} now */
  tick(now) {
    this.refresh = requestAnimationFrame((next) => this.tick(next));
    this.hearing?.tick();
    this.sidecar?.tick();
    const timeS = this.clock.at(now);
    const visibility = this.cuer.show(timeS, { ...this.choice, opacity: 100 });
    this.drawn = { timeS, nowMs: now, visibility };
    this.stage.showCuer(visibility > 0);
    this.showState(visibility);
    const { around } = this.stage;
    this.stage.showKeys(this.cuer.keysAround(timeS, around, around), this.words());
  }
}

if (!customElements.get("cuecast-player")) customElements.define("cuecast-player", CuecastPlayer);
