/** The participant's page: consent, then step by step an item, a question, an answer. */

import { ask, fetched, Player } from "./player.js";

/** @param {string} id */
const find = (id) => /** @type {any} */ (document.getElementById(id));

/** Silence with the cuer at rest before the first item, and between items, ms. */
const PAUSE_MS = 500;

/** Choice that stands for a step which asks nothing. */
const SEEN = -1;

/** @param {number} ms */
const wait = (ms) => new Promise((resolve) => { setTimeout(resolve, ms); });

class Test {
  /** @param {Player} player */
  constructor(player) {
    this.player = player;
    /** @type {Step["captions"]} */
    this.captions = [];
    player.onTick = (timeS) => this.showCaption(timeS);
  }

  /** @param {number} timeS */
  showCaption(timeS) {
    const shown = this.captions.find(([start, end]) => start <= timeS && timeS < end);
    const text = shown ? shown[2] : "";
    if (find("captions").textContent !== text) find("captions").textContent = text;
  }

  /** @param {Progress} progress */
  async run(progress) {
    find("welcome").hidden = true;
    find("screen").hidden = false;
    while (!progress.ended) {
      find("progress").textContent = `${progress.next + 1} sur ${progress.steps} · ${progress.code}`;
      progress = await this.step(progress.code);
    }
    find("screen").hidden = true;
    find("thanks").hidden = false;
    find("own-code").textContent = progress.code;
    find("thanks").querySelector("h1").focus();
  }

  /** Show and ask the next step; returns the progress after its answer. @param {string} code */
  async step(code) {
    const query = new URLSearchParams({ code }).toString();
    const step = await fetched(`/step.json?${query}`);
    find("box").textContent = "";
    let framesPerSecond = 0;
    if (step.moves) framesPerSecond = await this.show(step, query);
    find("screen").classList.toggle("asking", !step.moves);
    const answer = step.choices.length ? await ask(find("box"), step.prompt, step.choices) : { choice: SEEN, ms: 0 };
    this.captions = [];
    return fetched("/answer", { code, step: step.step, choice: answer.choice, answer_ms: answer.ms, frames_per_second: framesPerSecond });
  }

  /** Show an item; returns how many pictures a second were drawn. @param {Step} step @param {string} query */
  async show(step, query) {
    const drawn = step.display !== "none";
    find("screen").classList.remove("asking");
    find("figure").classList.toggle("empty", !drawn);
    if (drawn) this.player.cuer.choose(step.display);
    if (drawn && step.display === "avatar" && !this.player.cuer.avatar) throw new Error("Ce navigateur ne peut pas dessiner le personnage (WebGL manque).");
    await this.player.load(`/step.bin?${query}`);
    const sound = step.sound ? find("sound") : null;
    if (sound) {
      sound.src = `/sound?${query}&step=${step.step}`;
      await new Promise((resolve, reject) => {
        sound.oncanplaythrough = resolve;
        sound.onerror = () => reject(new Error("Le son ne peut pas être lu."));
      });
    }
    this.captions = step.captions;
    await wait(PAUSE_MS);
    const end = await this.player.play({ sound });
    if (!end.whole) throw new Error("L’élément n’a pas pu être montré en entier.");
    return end.framesPerSecond;
  }
}

async function open() {
  const about = await fetched("/trial.json");
  for (const text of about.consent) {
    const paragraph = document.createElement("p");
    paragraph.textContent = text;
    find("consent").append(paragraph);
  }
  const test = new Test(await Player.open(find("figure")));
  find("begin").disabled = false;
  find("start").addEventListener("submit", async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    find("status").textContent = "";
    try {
      const progress = await fetched("/start", { consent: find("agree").checked, code: find("code").value.trim() });
      await test.run(progress);
    } catch (error) {
      find("status").textContent = `${error.message} Rien n’est perdu : rechargez la page et donnez votre code.`;
    }
  });
}

open().catch((error) => { find("status").textContent = error.message; });
