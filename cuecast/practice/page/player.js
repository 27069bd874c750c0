/**
 * Practice and tests in one engine: show an item, with or without sound, then ask and time the answer.
 *
 * The cuer is drawn by the scripts of the television's page.
 */

import { parseAvatar } from "./avatar.js";
import { Cuer } from "./cuer.js";
import { parseMotion } from "./feed.js";
import { VoiceModel } from "./model.js";

/** Frames by which a still picture is kept: the timeline holds what it knows. */
const STILL_FRAMES = 2;

/**
 * A document of this server; its refusals become errors with their own words.
 * @param {any} [body] sent as JSON
 * @param {string} path
 */
export async function fetched(path, body = undefined) {
  const options = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  const answer = await fetch(path, options);
  if (answer.headers.get("Content-Type")?.startsWith("application/json")) {
    const found = await answer.json();
    if (!answer.ok) throw new Error(found.error);
    return found;
  }
  if (!answer.ok) throw new Error(`${path} : ${answer.status}`);
  return answer.arrayBuffer();
}

export class Player {
  /**
   * `figure`: the element that holds the canvases `.points` and `.avatar`.
   * @param {VoiceModel} model @param {Arrays|null} arrays @param {HTMLElement} figure
   */
  constructor(model, arrays, figure) {
    this.model = model;
    /** @param {string} name */
    const canvas = (name) => /** @type {HTMLCanvasElement} */ (figure.querySelector(name));
    this.cuer = new Cuer(model, arrays, { points: canvas(".points"), avatar: canvas(".avatar") });
    this.look = { opacity: 100, dot: 100, mirror: false, handOnly: false, contrast: "panel" };
    this.speed = 1;
    this.durationS = 0;
    this.timeS = 0;
    /** @type {any} */
    this.run = null;
    /** @type {(timeS: number) => void} */
    this.onTick = () => {};
    requestAnimationFrame((now) => this.tick(now));
  }

  /** Fetch voice and avatar and build a player. @param {HTMLElement} figure */
  static async open(figure) {
    const [voice, avatar] = await Promise.all(["/voice.json", "/avatar.bin"].map((path) => fetch(path)));
    const arrays = avatar.ok ? parseAvatar(await avatar.arrayBuffer()) : null;
    return new Player(new VoiceModel(await voice.json()), arrays, figure);
  }

  /** Take the motion of an item, and its keys where they are known. @param {string} path @param {Key[]} [keys] */
  async load(path, keys = []) {
    const piece = parseMotion(await fetched(path));
    this.take(piece, keys);
  }

  /** @param {Piece} piece @param {Key[]} [keys] */
  take(piece, keys = []) {
    this.stop();
    this.cuer.timeline.clear();
    this.cuer.timeline.insert(piece);
    this.cuer.timeline.insertKeys(keys);
    this.cuer.forget();
    this.durationS = piece.count / piece.rateHz;
    this.timeS = 0;
  }

  /** Show parameters that stand still. @param {Float64Array} params */
  hold(params) {
    const frames = new Float32Array(STILL_FRAMES * params.length);
    for (let i = 0; i < STILL_FRAMES; i++) frames.set(params, i * params.length);
    this.take({ startS: 0, rateHz: 1, count: STILL_FRAMES, width: params.length, frames, concealed: false, layers: 3, epoch: 0 });
  }

  /**
   * Play from `from` to `until` seconds, once or again and again, beside `sound` if there is one.
   *
   * Resolves at the end with `{whole, framesPerSecond}`; `whole` is false if it was stopped.
   * @param {{from?: number, until?: number, loop?: boolean, sound?: HTMLMediaElement | null}} [how]
   */
  play({ from = 0, until = this.durationS, loop = false, sound = null } = {}) {
    this.stop();
    return new Promise((resolve) => {
      this.run = { from, until, loop, sound, resolve, startMs: NaN, frames: 0, lengthMs: 0 };
      if (sound) {
        sound.currentTime = from;
        sound.play().catch(() => this.stop());
      }
    });
  }

  stop() {
    const run = this.run;
    if (!run) return;
    this.run = null;
    if (run.sound) run.sound.pause();
    run.resolve({ whole: false, framesPerSecond: rate(run) });
  }

  /** @param {number} now */
  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    const run = this.run;
    if (run) this.advance(run, now);
    this.cuer.show(Math.min(this.timeS, this.durationS), this.look);
    this.onTick(this.timeS);
  }

  /** @param {any} run @param {number} now */
  advance(run, now) {
    if (Number.isNaN(run.startMs)) run.startMs = now;
    run.lengthMs = now - run.startMs;
    run.frames += 1;
    const elapsedS = run.sound ? run.sound.currentTime - run.from : run.lengthMs / 1000 * this.speed;
    this.timeS = Math.min(run.from + elapsedS, run.until);
    const silent = run.sound && run.sound.ended;
    if (this.timeS < run.until && !silent) return;
    if (run.loop) {
      run.startMs = now;
      run.frames = 0;
      return;
    }
    this.run = null;
    this.timeS = run.until;
    if (run.sound) run.sound.pause();
    run.resolve({ whole: true, framesPerSecond: rate(run) });
  }
}

/** @param {{lengthMs: number, frames: number}} run */
function rate(run) {
  return run.lengthMs > 0 ? (run.frames - 1) * 1000 / run.lengthMs : 0;
}

/**
 * Ask in `box`: a prompt and one button per choice; resolves with `{choice, ms}`.
 *
 * Digits choose too, and with two choices the left and right arrows. Time runs from the first
 * refresh that shows the choices.
 * @param {HTMLElement} box @param {string} prompt @param {string[]} choices
 */
export function ask(box, prompt, choices) {
  box.textContent = "";
  const title = document.createElement("h2");
  title.textContent = prompt;
  title.tabIndex = -1;
  const row = document.createElement("div");
  row.className = choices.length > 3 ? "answers many" : "answers";
  row.setAttribute("role", "group");
  row.setAttribute("aria-label", prompt);
  box.append(title, row);
  return new Promise((resolve) => {
    let shownMs = performance.now();
    requestAnimationFrame((now) => { shownMs = now; });
    /** @param {number} choice */
    const done = (choice) => {
      const ms = Math.max(0, performance.now() - shownMs);
      document.removeEventListener("keydown", onKey);
      for (const button of row.children) /** @type {HTMLButtonElement} */ (button).disabled = true;
      row.children[choice].classList.add("chosen");
      resolve({ choice, ms });
    };
    /** @param {KeyboardEvent} event */
    const onKey = (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
      const arrow = choices.length === 2 ? ["ArrowLeft", "ArrowRight"].indexOf(event.key) : -1;
      const choice = arrow >= 0 ? arrow : Number(event.key) - 1;
      if (!(choice >= 0 && choice < choices.length) || event.key === " ") return;
      event.preventDefault();
      done(choice);
    };
    choices.forEach((text, i) => {
      const button = document.createElement("button");
      const digit = document.createElement("kbd");
      digit.textContent = `${i + 1}`;
      digit.setAttribute("aria-hidden", "true");
      button.append(digit, text);
      button.onclick = () => done(i);
      row.append(button);
    });
    document.addEventListener("keydown", onKey);
    title.focus({ preventScroll: true });
  });
}
