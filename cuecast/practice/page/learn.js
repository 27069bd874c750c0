/** The learner's page: a sentence slowly, a syllable in a loop, quizzes. */

import { ask, fetched, Player } from "./player.js";
import { group, PLACES, spelled } from "./spelling.js";

/** @param {string} id */
const find = (id) => /** @type {any} */ (document.getElementById(id));

/** Time before and after a key that a loop shows, seconds: the hand's way there, and its stay. */
const BEFORE_S = 0.35;
const AFTER_S = 0.15;

const QUESTIONS = 10;

/** Phones that no question of keys names: hardly a syllable begins with them alone. */
const SELDOM = ["ɥ", "w", "ŋ"];

/** How long after its begin a phrase counts as the one that was just seen, seconds. */
const SLACK_S = 0.3;

class Learner {
  /** @param {Player} player */
  constructor(player) {
    this.player = player;
    /** @type {any} An `Item` with its `query`, or null. */
    this.item = null;
    this.shownNow = -1;
    this.quiz = 0;
    this.turn = 0;
    player.onTick = () => this.showNow();
    this.listen();
    this.apply();
    this.view("phrase");
  }

  listen() {
    for (const button of document.querySelectorAll("nav button")) {
      button.addEventListener("click", () => this.view(/** @type {HTMLElement} */ (button).dataset.view || ""));
    }
    find("form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
      event.preventDefault();
      this.sentence();
    });
    find("replay").onclick = () => this.replay();
    find("phrase-again").onclick = () => this.lastPhrase();
    find("stop").onclick = () => this.player.stop();
    for (const id of ["speed", "style", "mirror"]) find(id).onchange = () => this.apply();
    find("lips").onchange = () => this.reload();
    find("doubles-start").onclick = () => this.doubles();
    find("gestures-start").onclick = () => this.gestures();
    document.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || /** @type {HTMLElement} */ (event.target).closest("textarea, select, button, a, summary")) {
      if (event.key === "Escape") this.player.stop();
      return;
    }
    /** @type {Record<string, () => void>} */
    const acts = {
      " ": () => this.replay(), r: () => this.lastPhrase(), Escape: () => this.player.stop(),
      m: () => { find("mirror").checked = !find("mirror").checked; this.apply(); },
    };
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  /** Bring the player in line with the settings. */
  apply() {
    this.player.speed = Number(find("speed").value);
    this.player.cuer.choose(find("style").value);
    this.player.look = { ...this.player.look, mirror: find("mirror").checked };
    this.player.cuer.forget();
  }

  /** @param {string} text */
  say(text) {
    find("status").textContent = text;
  }

  /** @param {string} name */
  view(name) {
    this.quiz += 1;
    this.player.stop();
    this.say("");
    for (const button of document.querySelectorAll("nav button")) {
      const own = /** @type {HTMLElement} */ (button).dataset.view === name;
      button.setAttribute("aria-pressed", String(own));
    }
    for (const id of ["phrase", "doubles", "gestures"]) find(id).hidden = id !== name;
    for (const id of ["doubles", "gestures"]) {
      find(`${id}-box`).textContent = "";
      find(`${id}-start`).hidden = false;
    }
    find("phrase-again").hidden = name !== "phrase";
    find("replay").hidden = name === "gestures";
    if (name === "phrase") this.sentence(false);
    else this.still(1, "side");
  }

  /** Stand still with a key. @param {number} shape @param {string} placement */
  still(shape, placement) {
    this.item = null;
    this.player.hold(this.player.model.target(shape, Object.keys(PLACES).indexOf(placement)));
  }

  /** @param {PlayOptions} [options] */
  async play(options = {}) {
    find("stop").disabled = false;
    const end = await this.player.play(options);
    if (!this.player.run) find("stop").disabled = true;
    return end;
  }

  /** Fetch an item and take it; `query` names it. Returns whether it was there. @param {string} query */
  async fetchItem(query) {
    const turn = ++this.turn;
    try {
      const item = await fetched(`/item.json?${query}`);
      if (turn !== this.turn) return false;
      this.item = { query, ...item };
      await this.reload();
      return true;
    } catch (error) {
      if (turn === this.turn) this.say(error.message);
      return false;
    }
  }

  /** Take the item again: with or without the hand. */
  async reload() {
    if (!this.item) return;
    await this.player.load(`/item.bin?${this.item.query}&hand=${find("lips").checked ? 0 : 1}`, this.item.keys);
  }

  async sentence(play = true) {
    const text = find("text").value.trim();
    const query = new URLSearchParams({ text }).toString();
    find("sheet").href = `/page/sheet.html?${query}`;
    this.say(play ? "La phrase se prépare…" : "");
    if (!await this.fetchItem(query)) return;
    this.say("");
    this.showKeys();
    if (play) this.play();
  }

  replay() {
    if (this.item) this.play();
  }

  /** Play the phrase that was being shown, or the one shown last, again. */
  lastPhrase() {
    if (!this.item) return;
    const begun = this.item.phrases.filter((/** @type {number} */ startS) => startS - BEFORE_S <= this.player.timeS - SLACK_S);
    const from = begun.length ? begun[begun.length - 1] : this.item.phrases[0];
    const after = this.item.phrases.find((/** @type {number} */ startS) => startS > from);
    this.play({ from: Math.max(0, from - BEFORE_S), until: after ? after - BEFORE_S / 2 : this.player.durationS });
  }

  showKeys() {
    const list = find("keys");
    list.textContent = "";
    this.shownNow = -1;
    this.item.keys.forEach((/** @type {Key} */ key, /** @type {number} */ i) => {
      const entry = document.createElement("li");
      const button = document.createElement("button");
      const phones = document.createElement("b");
      const code = document.createElement("small");
      phones.textContent = key.phones.map(spelled).join("");
      code.textContent = `${key.shape} · ${PLACES[key.placement]}`;
      button.append(phones, code);
      button.onclick = () => this.loop(i);
      entry.append(button);
      list.append(entry);
    });
  }

  /** Repeat one key with the way to it. @param {number} index */
  loop(index) {
    const key = this.item.keys[index];
    this.play({ from: Math.max(0, key.start - BEFORE_S), until: Math.min(key.end + AFTER_S, this.player.durationS), loop: true });
  }

  /** Mark the key that the hand shows. */
  showNow() {
    const { keys, now } = this.item ? this.player.cuer.keysAround(this.player.timeS, 0, 0) : { keys: [], now: -1 };
    const at = now < 0 ? -1 : this.item.keys.findIndex((/** @type {Key} */ key) => key.start === keys[now].start);
    if (at === this.shownNow) return;
    this.shownNow = at;
    [...find("keys").children].forEach((entry, i) => {
      if (i === at) entry.firstChild.setAttribute("aria-current", "true");
      else entry.firstChild.removeAttribute("aria-current");
    });
  }

  /** Words that look alike: which one is cued? */
  async doubles() {
    const quiz = ++this.quiz;
    find("doubles-start").hidden = true;
    const questions = await fetched(`/doubles.json?seed=${Math.floor(Math.random() * 2 ** 31)}`);
    let score = 0;
    for (const [i, { words, right }] of questions.entries()) {
      const query = new URLSearchParams({ family: words[0], text: words[right] }).toString();
      if (!await this.fetchItem(query) || quiz !== this.quiz) return;
      this.say(`Question ${i + 1} sur ${questions.length}`);
      this.play();
      const { choice } = await ask(find("doubles-box"), "Quel mot ?", words);
      if (quiz !== this.quiz) return;
      score += Number(choice === right);
      const keys = this.item.keys.map((/** @type {Key} */ key) => `${key.phones.map(spelled).join("")} : ${key.shape}, ${PLACES[key.placement]}`).join(" ; ");
      if (choice !== right) this.play();
      await this.next("doubles", right, choice === right ? `Oui, « ${words[right]} » (${keys}).` : `Non, c’était « ${words[right]} » (${keys}). Regardez encore.`);
      if (quiz !== this.quiz) return;
    }
    this.end("doubles", score, questions.length);
  }

  /** A hand that stands still: which syllable can it be? */
  async gestures() {
    const quiz = ++this.quiz;
    find("gestures-start").hidden = true;
    const { shapes, placements } = await fetched("/chart.json");
    let score = 0;
    for (let i = 0; i < QUESTIONS; i++) {
      const [shape, otherShape] = drawn(Object.keys(shapes));
      const [place, otherPlace] = drawn(Object.keys(placements));
      this.still(Number(shape), place);
      const options = [[shape, place], [otherShape, place], [shape, otherPlace], [otherShape, otherPlace]];
      const order = drawn([0, 1, 2, 3]);
      const consonants = (/** @type {string} */ name) => shapes[name].filter((/** @type {string} */ phone) => !SELDOM.includes(phone));
      const words = order.map((k) => `${spelled(drawn(consonants(options[k][0]))[0])} + ${spelled(drawn(placements[options[k][1]])[0])}`);
      this.say(`Question ${i + 1} sur ${QUESTIONS}`);
      const { choice } = await ask(find("gestures-box"), "Quelle syllabe ?", words);
      if (quiz !== this.quiz) return;
      const right = order[choice] === 0;
      score += Number(right);
      const rule = `main ${shape} (${group(shapes[shape])}), ${PLACES[place]} (${group(placements[place])})`;
      await this.next("gestures", order.indexOf(0), right ? `Oui : ${rule}.` : `Non, c’était « ${words[order.indexOf(0)]} » : ${rule}.`);
      if (quiz !== this.quiz) return;
    }
    this.end("gestures", score, QUESTIONS);
  }

  /** Say how it was, mark the choice that was right and wait for the button that goes on. @param {string} name @param {number} right @param {string} text */
  next(name, right, text) {
    this.say(text);
    find(`${name}-box`).querySelectorAll(".answers button")[right].classList.add("right");
    return new Promise((resolve) => {
      const button = document.createElement("button");
      button.className = "main";
      button.textContent = "Suivante";
      button.onclick = resolve;
      find(`${name}-box`).append(button);
      button.focus();
    });
  }

  /** @param {string} name @param {number} score @param {number} count */
  end(name, score, count) {
    find(`${name}-box`).textContent = "";
    find(`${name}-start`).hidden = false;
    find(`${name}-start`).textContent = "Recommencer";
    this.say(`${score} sur ${count}.`);
  }
}

/** The entries in random order. @param {any[]} list */
function drawn(list) {
  const found = [...list];
  for (let i = found.length - 1; i > 0; i--) {
    const j = Math.floor(Math.random() * (i + 1));
    [found[i], found[j]] = [found[j], found[i]];
  }
  return found;
}

Player.open(find("figure")).then((player) => Object.assign(window, { learner: new Learner(player) }));
