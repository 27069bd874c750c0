/** Uses each name of the types; `npm run types` compiles it strictly and expects the marked errors. */

import type { CuecastKey, CuecastPlayer } from "./index.js";
import { Decoder, PHONES, type DecodedEvent } from "./decoder.js";

export function listen(player: CuecastPlayer): string[] {
  player.addEventListener("key", ({ detail }) => detail.phones.map((phone) => phone.length));
  player.addEventListener("state", ({ detail }) => detail.state === "deaf" && detail.reason);
  player.addEventListener("lost", ({ detail }) => detail.count.toFixed());
  player.addEventListener("verified", ({ detail }) => detail.of);
  // @ts-expect-error: a state has no shape
  player.addEventListener("state", ({ detail }) => detail.shape);
  // @ts-expect-error: keys are read
  player.keyList = [];
  return player.keyList.map((key: CuecastKey) => `${key.start} ${key.placement}`);
}

export function place(): void {
  const player = document.createElement("cuecast-player");
  player.media?.play();
  // @ts-expect-error: there may be no diagnosis yet
  player.diagnosis.superframes.toFixed();
}

export async function decode(module: ArrayBuffer, voice: ArrayBuffer, file: ArrayBuffer): Promise<DecodedEvent[]> {
  const decoder = await Decoder.create(module, voice, { rateHz: 48000, channels: 2 });
  const events = decoder.push([new Float32Array(128), new Float32Array(128)]);
  const { superframes } = decoder.open(file);
  for (let i = 0; i < superframes; i++) events.push(...(decoder.read() ?? []));
  for (const event of events) {
    if (event.kind === "motion") event.values.fill(0);
    // @ts-expect-error: only keys have phones
    event.phones;
  }
  // @ts-expect-error: a voice is bytes
  await Decoder.create(module, "claire", { rateHz: 48000, channels: 2 });
  return PHONES.length > 0 ? events : decoder.flush();
}
