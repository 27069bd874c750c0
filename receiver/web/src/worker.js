/**
 * Decodes away from the page: sound from the worklet's port, events to the element.
 *
 * From the element: {type: "open", module, voice, rateHz, channels, port, announcement, toleranceS};
 * for sound {type: "hear", segment, fromS, live}, {type: "pause"}, {type: "resume"} and {type: "stop"}; for a stream file {type:
 * "file", bytes} and {type: "read", anew, fromS, untilS}. To it: {type: "heard", segment, events,
 * pieces, diagnosis, lagS}, {type: "opened", startS, durationS, superframes} and {type: "failed",
 * text}. Times of a file are the programme's; those of sound are the receiver's, which counts
 * samples: with `lagS` added they are seconds of the audio context.
 *
 * A paused programme is silent. Exact zeros are held back until sound follows, and dropped if the
 * programme was paused meanwhile: to the receiver the sound goes on where it stopped.
 */

import { Decoder } from "./decoder.js";
import { Pieces } from "./pieces.js";

const DIAGNOSE_S = 0.5;
const HELD_S = 0.5;
const SUPERFRAME_S = 0.64;
/** Superframes of a stream file that are sent to the page at a time. */
const BATCH = 16;

/** @type {any} */
let decoder = null;
/** @type {any} */
let opening = null;
let rateHz = 48000;
let pieces = new Pieces();
let segment = -1;
let fromS = Infinity;
let begun = false;
/** Whether the programme is on air now: its proofs have an age then. */
let live = false;
/** "playing", "paused", or "resumed" until sound follows. */
let mode = "playing";
/** Receiver's time of the next sample, and when the last diagnosis was sent. */
let nextS = 0;
let toldS = 0;
/** Zeros that were held back, per channel. */
let held = 0;
/** The stream file, and how far it has been read, seconds. @type {any} */
let file = null;
let readS = 0;

/** @param {Float32Array[]} planes @param {number} at */
const isSilent = (planes, at) => planes.every((plane) => plane[at] === 0);

/** Bounds of what is not zero in a block; both are the block's length if there is nothing else. @param {Float32Array[]} planes */
function soundWithin(planes) {
  const { length } = planes[0];
  let first = 0;
  while (first < length && isSilent(planes, first)) first += 1;
  let end = length;
  while (end > first && isSilent(planes, end - 1)) end -= 1;
  return [first, first === length ? length : end];
}

/** Sort out motion from what is sent as it is. @param {any[]} all */
function sorted(all) {
  const events = [];
  for (const event of all) {
    if (event.kind === "motion") pieces.add(event);
    else events.push(event);
  }
  return events;
}

/** @param {Float32Array[]} planes */
function push(planes) {
  if (live) decoder.clock(Date.now() / 1000);
  nextS += planes[0].length / rateHz;
  return sorted(decoder.push(planes));
}

/**
 * Decode the stream file up to a time; what lies before `from` is known to the page, or not needed.
 * @param {{anew: boolean, fromS: number, untilS: number}} wanted
 */
function read({ anew, fromS: from, untilS }) {
  if (anew) {
    readS = decoder.open(file).startS;
    pieces = new Pieces();
  }
  const events = [];
  for (let count = 1; readS < untilS; count++) {
    const found = decoder.read();
    if (!found) break;
    readS += SUPERFRAME_S;
    events.push(...sorted(found.filter((/** @type {{timeS: number}} */ event) => event.timeS >= from)));
    if (count % BATCH === 0) send(events.splice(0));
  }
  send(events);
}

/** @param {any[]} events */
function send(events) {
  self.postMessage({ type: "heard", segment, events, pieces: pieces.take(), diagnosis: null, lagS: 0 });
}

/** Push the zeros held back, at most a number of them. @param {number} most */
function pushZeros(most) {
  const count = Math.min(held, most);
  held -= count;
  return count ? push([new Float32Array(count), new Float32Array(count)]) : [];
}

/** @param {any} message */
async function opened({ module, voice, rateHz: rate, channels, announcement, toleranceS }) {
  const made = await Decoder.create(module, voice, { rateHz: rate, channels });
  if (announcement) made.trust(announcement, toleranceS);
  return made;
}

/** @param {{timeS: number, planes: Float32Array[]}} block */
function hear({ timeS, planes }) {
  if (!decoder || segment < 0 || timeS < fromS) return;
  if (!begun) {
    decoder.reset(timeS);
    pieces = new Pieces();
    begun = true;
    nextS = toldS = timeS;
    held = 0;
  }
  const { length } = planes[0];
  const [first, end] = soundWithin(planes);
  held += first;
  const events = [];
  if (first < length) {
    if (mode !== "playing") held = 0;
    if (mode === "resumed") mode = "playing";
    events.push(...pushZeros(Infinity), ...push(planes.map((plane) => plane.subarray(first, end))));
    held = length - end;
  } else if (mode === "playing" && held > HELD_S * rateHz) events.push(...pushZeros(length));
  const changed = pieces.take();
  if (!events.length && !changed.length && (mode !== "playing" || nextS - toldS < DIAGNOSE_S)) return;
  toldS = nextS;
  const lagS = timeS + (length - held) / rateHz - nextS;
  self.postMessage({ type: "heard", segment, events, pieces: changed, diagnosis: decoder.diagnosis(), lagS });
}

/** @param {(data: any) => void|Promise<void>} action */
function guarded(action) {
  return async (/** @type {MessageEvent} */ event) => {
    try {
      await action(event.data);
    } catch (error) {
      segment = -1;
      self.postMessage({ type: "failed", text: error.message });
    }
  };
}

self.onmessage = guarded(async (message) => {
  if (message.type === "open") {
    ({ rateHz } = message);
    opening = opened(message);
    decoder = await opening;
    if (message.port) message.port.onmessage = guarded(hear);
  } else if (message.type === "file") {
    decoder = await opening;
    file = message.bytes;
    const info = decoder.open(file);
    readS = info.startS;
    self.postMessage({ type: "opened", ...info });
  } else if (message.type === "read") {
    read(message);
  } else if (message.type === "hear") {
    ({ segment, fromS, live } = message);
    begun = false;
    mode = "playing";
  } else if (message.type === "pause") mode = "paused";
  else if (message.type === "resume") mode = "resumed";
  else segment = -1;
});
