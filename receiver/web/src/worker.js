/**
 * Decodes away from the page: sound from the worklet's port, events to the element.
 *
 * From the element: {type: "open", module, voice, rateHz, channels, port}, {type: "hear", segment,
 * fromS} and {type: "stop"}. To it: {type: "heard", segment, events, pieces, diagnosis} and
 * {type: "failed", text}. Times are seconds of the audio context.
 */

import { Decoder } from "./decoder.js";
import { Pieces } from "./pieces.js";

let decoder = null;
let pieces = new Pieces();
let segment = -1;
let fromS = Infinity;
let begun = false;
let told = 0;

const DIAGNOSE_S = 0.5;

function hear({ timeS, planes }) {
  if (!decoder || segment < 0 || timeS < fromS) return;
  if (!begun) {
    decoder.reset(timeS);
    pieces = new Pieces();
    begun = true;
    told = timeS;
  }
  const events = [];
  for (const event of decoder.push(planes)) {
    if (event.kind === "motion") pieces.add(event);
    else events.push(event);
  }
  const changed = pieces.take();
  if (!events.length && !changed.length && timeS - told < DIAGNOSE_S) return;
  told = timeS;
  self.postMessage({ type: "heard", segment, events, pieces: changed, diagnosis: decoder.diagnosis() });
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
    message.port.onmessage = guarded(hear);
  } else if (message.type === "hear") {
    ({ segment, fromS } = message);
    begun = false;
  } else segment = -1;
});
