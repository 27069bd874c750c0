/**
 * Hearing of a media element: its sound goes through a worklet to the decoder's worker.
 *
 * The sound is rerouted only where the page may hear it and the audio context runs: otherwise the
 * browser would mute the programme. A reroute cannot be undone, so it is kept per media element.
 */

/** The clock is known from so many readings, or from a few that agree. */
const SETTLED = 15;
const FEW = 5;
const AGREE_S = 0.015;
const KEPT = 240;
/** A pause ends where it began, but for this. */
const SAME_PLACE_S = 0.1;
const GESTURES = ["pointerdown", "keydown"];
const QUIET_DBFS = -120;
const QUIET_S = 4;
const SEARCHED_S = 10;
const WAKE_MS = 3000;

/** Media element to `{context, source}`: a source can be made once. */
const rerouted = new WeakMap();

/** Why the page may not hear `media`: a name of `REASONS`, or "" if it may. @param {HTMLMediaElement|null} media */
export function obstacle(media) {
  if (!media) return "no-media";
  if (!isSecureContext) return "insecure";
  if (typeof AudioWorkletNode === "undefined") return "no-worklet";
  if (typeof WebAssembly === "undefined") return "no-module";
  const address = media.currentSrc || media.src;
  if (address && !address.startsWith("data:") && !media.crossOrigin) {
    if (new URL(address, location.href).origin !== location.origin) return "other-origin";
  }
  return "";
}

export class Hearing {
  /** @type {any} */
  worker;
  /** @type {any} */
  context;
  /** @type {any} */
  source;
  /** @type {any} */
  node;

  /**
   * `files`: {module, voice, worklet, worker, trust}; `handlers`: heard(message, offsetS), reason(name, text).
   * @param {HTMLMediaElement} media @param {PlayerFiles} files @param {HearingHandlers} handlers
   */
  constructor(media, files, handlers) {
    this.media = media;
    this.files = files;
    this.handlers = handlers;
    this.segment = 0;
    /** @type {number[]} Media time less the audio context's, as read at refreshes. */
    this.offsets = [];
    this.hearing = false;
    this.pausedAtS = null;
    this.readAtS = NaN;
    /** Media time less the receiver's, seconds; a pause does not change it. */
    this.placeS = null;
    /** @type {Promise<void> | null} */
    this.opened = null;
    this.locked = false;
    /** @type {[string, () => void][]} */
    this.listeners = [
      ["playing", () => this.begin()], ["pause", () => this.pause()], ["seeking", () => this.stop()],
      ["seeked", () => this.begin()], ["waiting", () => this.pause()],
      ["ratechange", () => { this.stop(); this.begin(); }], ["volumechange", () => this.checkMuted()], ["emptied", () => this.stop()],
    ];
    for (const [name, listener] of this.listeners) media.addEventListener(name, listener);
    if (!media.paused && media.readyState > 2) this.begin();
  }

  /** Hear from now on, if the page may; goes on where the programme was paused. */
  async begin() {
    const { media, pausedAtS } = this;
    if (media.paused || this.hearing) return;
    if (pausedAtS !== null && Math.abs(media.currentTime - pausedAtS) < SAME_PLACE_S) return this.resume();
    this.stop();
    const reason = obstacle(media);
    if (reason) return this.handlers.reason(reason);
    if (media.playbackRate !== 1) return this.handlers.reason("speed");
    try {
      this.opened ??= this.open();
      await this.opened;
    } catch (error) {
      this.opened = null;
      if (error.reason === "asleep") this.awaitGesture();
      return this.handlers.reason(error.reason || "failed", error.message);
    }
    if (media.paused || media.seeking || media.playbackRate !== 1) return;
    this.segment += 1;
    this.offsets = [];
    this.placeS = null;
    this.locked = false;
    this.hearing = true;
    this.handlers.reason(this.checkMuted() ? "muted" : "");
    this.worker.postMessage({ type: "hear", segment: this.segment, fromS: this.context.currentTime, live: media.duration === Infinity });
  }

  /** The programme stands still: its sound will go on from here. */
  pause() {
    if (!this.hearing) return;
    this.pausedAtS = this.media.currentTime;
    this.worker.postMessage({ type: "pause" });
    this.hearing = false;
  }

  resume() {
    this.pausedAtS = null;
    this.offsets = [];
    this.hearing = true;
    this.worker.postMessage({ type: "resume" });
  }

  stop() {
    if (this.hearing || this.pausedAtS !== null) this.worker.postMessage({ type: "stop" });
    this.hearing = false;
    this.pausedAtS = null;
  }

  /** Try again at the viewer's next click or key press anywhere in the page. */
  awaitGesture() {
    const again = () => {
      for (const name of GESTURES) document.removeEventListener(name, again, true);
      this.begin();
    };
    for (const name of GESTURES) document.addEventListener(name, again, true);
  }

  checkMuted() {
    const muted = this.media.muted || this.media.volume === 0;
    if (this.hearing && muted) this.handlers.reason("muted");
    return muted;
  }

  /** Reroute the sound and start the worker; rejects with `reason`, having changed nothing. */
  async open() {
    const known = rerouted.get(this.media);
    const context = known ? known.context : new AudioContext();
    await Promise.race([context.resume(), new Promise((done) => setTimeout(done, WAKE_MS))]);
    if (context.state !== "running") {
      if (!known) context.close();
      throw because("asleep");
    }
    const { module, voice, worklet, worker, trust } = this.files;
    try {
      if (!known) await context.audioWorklet.addModule(worklet);
      this.worker = new Worker(worker, { type: "module" });
    } catch (error) {
      if (!known) context.close();
      throw because("no-files", error.message);
    }
    const { port1, port2 } = new MessageChannel();
    this.worker.onmessage = (/** @type {MessageEvent} */ { data }) => this.receive(data);
    this.worker.onerror = (/** @type {ErrorEvent} */ event) => this.handlers.reason("failed", event.message);
    this.worker.postMessage({ type: "open", module, voice, rateHz: context.sampleRate, channels: 2, port: port1, ...trust }, [port1]);
    const node = new AudioWorkletNode(context, "cuecast-hearing", { numberOfOutputs: 0 });
    node.port.postMessage(port2, [port2]);
    const source = known ? known.source : context.createMediaElementSource(this.media);
    source.connect(node);
    if (!known) source.connect(context.destination);
    rerouted.set(this.media, { context, source });
    Object.assign(this, { context, source, node });
  }

  /** @param {any} message */
  receive(message) {
    if (message.type === "failed") return this.handlers.reason("failed", message.text);
    if (message.segment !== this.segment) return;
    this.tick();
    if (this.settled()) this.placeS = this.offset() + message.lagS;
    if (this.placeS === null) return this.keep(message);
    this.judge(message);
    for (const kept of this.kept.splice(0)) this.handlers.heard(kept, this.placeS);
    this.handlers.heard(message, this.placeS);
  }

  /** Whether media time is known against the context's. */
  settled() {
    const { offsets } = this;
    const last = offsets.slice(-FEW);
    return offsets.length >= SETTLED || (last.length === FEW && Math.max(...last) - Math.min(...last) < AGREE_S);
  }

  /** Hold back what came before the clock was known. @param {any} message */
  keep(message) {
    if (this.keptOf !== this.segment) this.kept.length = 0;
    this.keptOf = this.segment;
    this.kept.push(message);
  }

  /** @type {any[]} Messages that wait for the clock. */
  kept = [];
  keptOf = -1;

  /** Tell why nothing is received although the programme plays. @param {any} message */
  judge({ events, diagnosis }) {
    if (events.some((/** @type {{kind: string}} */ event) => event.kind === "unreadable")) this.handlers.reason("other-voice");
    if (diagnosis.superframes && !this.locked) {
      this.locked = true;
      this.handlers.reason("");
    }
    if (this.locked || this.checkMuted()) return;
    if (Math.max(...diagnosis.levelsDbfs) < QUIET_DBFS) {
      if (diagnosis.heardS > QUIET_S) this.handlers.reason("silence");
    } else if (diagnosis.heardS > SEARCHED_S) this.handlers.reason("no-mark");
  }

  /** Read media time against the context's time; call at each refresh. */
  tick() {
    const { currentTime, seeking, paused } = this.media;
    if (!this.hearing || seeking || paused || currentTime === this.readAtS) return;
    this.readAtS = currentTime;
    this.offsets.push(currentTime - this.context.currentTime);
    if (this.offsets.length > KEPT) this.offsets.shift();
  }

  /** Media time less the context's time, seconds: the median, as both clocks go in steps. */
  offset() {
    const sorted = [...this.offsets].sort((a, b) => a - b);
    return sorted[sorted.length >> 1];
  }

  close() {
    for (const [name, listener] of this.listeners) this.media.removeEventListener(name, listener);
    this.stop();
    this.worker?.terminate();
    if (this.node) this.source.disconnect(this.node);
  }
}

/** @param {string} reason @param {string} [text] */
function because(reason, text = "") {
  return Object.assign(new Error(text || reason), { reason });
}
