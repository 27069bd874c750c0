/**
 * Decodes away from the page: sound from the worklet's port, events to the element.
 *
 * From the element: {type: "open", module, voice, rateHz, channels, port}, {type: "hear", segment,
 * fromS}, {type: "pause"}, {type: "resume"} and {type: "stop"}. To it: {type: "heard", segment, events, pieces,
 * diagnosis, lagS} and {type: "failed", text}. Times are those of the receiver, which counts
 * samples: with `lagS` added they are seconds of the audio context.
 *
 * A paused programme is silent. Exact zeros are held back until sound follows, and dropped if the
 * programme was paused meanwhile: to the receiver the sound goes on where it stopped.
 */

import { Decoder } from "./decoder.js";
import { Pieces } from "./pieces.js";

const DIAGNOSE_S = 0.5;
const HELD_S = 0.5;

let decoder = null;
let rateHz = 48000;
let pieces = new Pieces();
let segment = -1;
let fromS = Infinity;
let begun = false;
/** "playing", "paused", or "resumed" until sound follows. */
let mode = "playing";
/** Receiver's time of the next sample, and when the last diagnosis was sent. */
let nextS = 0;
let toldS = 0;
/** Zeros that were held back, per channel. */
let held = 0;

const isSilent = (planes, at) => planes.every((plane) => plane[at] === 0);

/** Bounds of what is not zero in a block; both are the block's length if there is nothing else. */
function soundWithin(planes) {
  const { length } = planes[0];
  let first = 0;
  while (first < length && isSilent(planes, first)) first += 1;
  let end = length;
  while (end > first && isSilent(planes, end - 1)) end -= 1;
  return [first, first === length ? length : end];
}

function push(planes) {
  nextS += planes[0].length / rateHz;
  const events = [];
  for (const event of decoder.push(planes)) {
    if (event.kind === "motion") pieces.add(event);
    else events.push(event);
  }
  return events;
}

/** Push the zeros held back, at most a number of them. */
function pushZeros(most) {
  const count = Math.min(held, most);
  held -= count;
  return count ? push([new Float32Array(count), new Float32Array(count)]) : [];
}

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

function guarded(action) {
  return async (event) => {
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
    decoder = await Decoder.create(message.module, message.voice, message);
    ({ rateHz } = message);
    message.port.onmessage = guarded(hear);
  } else if (message.type === "hear") {
    ({ segment, fromS } = message);
    begun = false;
    mode = "playing";
  } else if (message.type === "pause") mode = "paused";
  else if (message.type === "resume") mode = "resumed";
  else segment = -1;
});
