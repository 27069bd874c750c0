/** A sheet to print: each key of a text with the hand drawn, the lips those of its last sound. */

import { fetched, Player } from "./player.js";
import { PLACES, spelled } from "./spelling.js";

/** @param {string} id */
const find = (id) => /** @type {any} */ (document.getElementById(id));

/** Left, top and size of the part that is printed, as shares of the whole picture. */
const CROP = [0.15, 0.13, 0.73];

/** Width of a printed picture in pixels. */
const WIDTH = 360;

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
  find("text").textContent = text;
  find("print").onclick = () => window.print();
  const query = new URLSearchParams({ text }).toString();
  /** @type {Item} */
  const { keys } = await fetched(`/item.json?${query}`);
  const player = await Player.open(find("figure"));
  await player.load(`/item.bin?${query}`);
  const pictures = keys.map((key) => picture(player, key));
  keys.forEach((key, i) => {
    player.hold(pictures[i]);
    player.cuer.show(0, player.look);
    find("cells").append(cell(key, cropped(player.cuer.view.canvas)));
  });
  find("status").textContent = "";
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

/** @param {Key} key @param {string} url */
function cell(key, url) {
  const entry = document.createElement("li");
  const image = document.createElement("img");
  const phones = document.createElement("b");
  const code = document.createElement("small");
  const name = key.phones.map(spelled).join("");
  image.src = url;
  image.alt = `Main ${key.shape}, ${PLACES[key.placement]}`;
  phones.textContent = name;
  code.textContent = `${key.shape} · ${PLACES[key.placement]}`;
  entry.append(image, phones, code);
  return entry;
}

draw().catch((error) => { find("status").textContent = error.message; });
