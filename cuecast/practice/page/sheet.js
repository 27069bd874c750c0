/** A sheet to print: the keys of a text, each with the lips of its last sound, or without a text the chart of all keys. */

import { fetched, Player } from "./player.js";
import { group, PLACES, spelled } from "./spelling.js";

/** @param {string} id */
const find = (id) => /** @type {any} */ (document.getElementById(id));

/** Left, top and size of the part that is printed, as shares of the whole picture. */
const CROP = [0.15, 0.11, 0.76];

/** Width of a printed picture in pixels. */
const WIDTH = 360;

/** Hand of a vowel without consonant, place of a consonant without vowel. */
const EMPTY_SHAPE = "5";
const EMPTY_PLACE = "side";

/** The parameters of a key's picture: the hand on its target, the face as in the middle of its last phone. @param {Player} player @param {Key} key */
function picture(player, key) {
  const params = player.model.target(key.shape, Object.keys(PLACES).indexOf(key.placement));
  const spoken = new Float64Array(params.length);
  const share = key.phones.length > 1 ? 0.75 : 0.5;
  player.cuer.timeline.sample(key.start + share * (key.end - key.start), spoken);
  params.set(spoken.subarray(0, player.model.offsets.hand));
  return params;
}

async function draw() {
  const text = new URLSearchParams(location.search).get("text") || "";
  find("text").textContent = text || "Tableau des clés";
  find("print").onclick = () => window.print();
  const player = await Player.open(find("figure"));
  for (const { params, name, code, hand } of await (text ? keysOf(text, player) : chart(player))) {
    player.hold(params);
    player.cuer.show(0, player.look);
    find("cells").append(cell(cropped(player.cuer.view.canvas), name, code, hand));
  }
  find("status").textContent = "";
}

/** The keys of a text. @param {string} text @param {Player} player */
async function keysOf(text, player) {
  const query = new URLSearchParams({ text }).toString();
  /** @type {Item} */
  const { keys } = await fetched(`/item.json?${query}`);
  await player.load(`/item.bin?${query}`);
  return keys.map((key) => ({
    params: picture(player, key),
    name: key.phones.map(spelled).join(""),
    code: `${key.shape} · ${PLACES[key.placement]}`,
    hand: `Main ${key.shape}, ${PLACES[key.placement]}`,
  }));
}

/** The eight hands with their consonants, then the five places with their vowels. @param {Player} player */
async function chart(player) {
  /** @type {{shapes: Record<string, string[]>, placements: Record<string, string[]>}} */
  const { shapes, placements } = await fetched("/chart.json");
  const target = (/** @type {number} */ shape, /** @type {string} */ place) => player.model.target(shape, Object.keys(PLACES).indexOf(place));
  const hands = Object.entries(shapes).map(([shape, phones]) => (
    { params: target(Number(shape), "side"), name: group(phones), code: shape === EMPTY_SHAPE ? `main ${shape}, ou sans consonne` : `main ${shape}`, hand: `Main ${shape}` }));
  const places = Object.entries(placements).map(([place, phones]) => (
    { params: target(1, place), name: group(phones), code: place === EMPTY_PLACE ? `${PLACES[place]}, ou sans voyelle` : PLACES[place], hand: `Place ${PLACES[place]}` }));
  return [...hands, ...places];
}

/** The part of a picture with head and hand, as an address. @param {HTMLCanvasElement} drawn */
function cropped(drawn) {
  const canvas = document.createElement("canvas");
  const [x, y, size] = CROP;
  canvas.width = WIDTH;
  canvas.height = Math.round(WIDTH * drawn.height / drawn.width);
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  context.drawImage(
    drawn, x * drawn.width, y * drawn.height, size * drawn.width, size * drawn.height, 0, 0, canvas.width, canvas.height,
  );
  return canvas.toDataURL();
}

/** @param {string} url @param {string} name @param {string} hand @param {string} described */
function cell(url, name, hand, described) {
  const entry = document.createElement("li");
  const image = document.createElement("img");
  const phones = document.createElement("b");
  const code = document.createElement("small");
  image.src = url;
  image.alt = described;
  phones.textContent = name;
  code.textContent = hand;
  entry.append(image, phones, code);
  return entry;
}

draw().catch((error) => { find("status").textContent = error.message; });
