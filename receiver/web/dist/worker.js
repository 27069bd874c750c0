const $decoder = (() => {
/**
 * The native receiver as WebAssembly: blocks of sound in, events out. Runs in a page, a worker and
 * node; it needs no other file and fetches none.
 *
 *     const decoder = await Decoder.create(module, voice, { rateHz: 48000, channels: 2 });
 *     for (const event of decoder.push([left, right])) if (event.kind === "key") ...
 *
 * The module imports nothing. Its memory above `__heap_base` is ours: the receiver's block, one
 * array per channel, an event. Offsets are those of `cuecast.h` in wasm32.
 */

const FRAMES = 4096;
const ALIGNMENT = 16;
const PAGE_BYTES = 65536;
const ROOM = { config: 64, event: 2048, diagnosis: 112, text: 512, info: 32 };
const CONFIG = { startS: 24, history: 36 };
const EVENT = { kind: 4, timeS: 8, body: 16 };
const INFO = { startS: 8, durationS: 16, superframes: 24 };

const STATES = ["searching", "locked", "degraded", "lost", "ended"];
const PROOFS = ["unknown", "verified", "forged", "unsigned"];
const PLACEMENTS = ["rest", "side", "mouth", "chin", "cheek", "throat"];

/** Symbols of the phones by number, rule G4 of the bit stream; 0 is a pause. */
const PHONES = [
  "_", "a", "ɑ", "o", "œ", "ə", "i", "ɔ̃", "ɑ̃", "ɛ", "ɔ", "u", "ɛ̃", "ø", "e", "y", "œ̃", "p", "d", "ʒ", "k", "v", "z",
  "s", "ʁ", "b", "n", "ɥ", "m", "t", "f", "l", "ʃ", "ɲ", "w", "g", "j", "ŋ",
];

class Decoder {
  /**
   * `module`: bytes or `WebAssembly.Module` of `cuecast.wasm`; `voice`: bytes of `voice.bin`;
   * `config`: {rateHz, channels, startS, history}. Rejects with the receiver's explanation.
   * @param {BufferSource|WebAssembly.Module} module @param {ArrayBuffer} voice @param {DecoderConfig} config
   */
  static async create(module, voice, config) {
    const compiled = module instanceof WebAssembly.Module ? module : await WebAssembly.compile(module);
    return new Decoder((await WebAssembly.instantiate(compiled, {})).exports, voice, config);
  }

  /** @param {any} exports @param {ArrayBuffer|null} voice @param {DecoderConfig} config */
  constructor(exports, voice, { rateHz, channels, startS = 0, history = true }) {
    this.cue = exports;
    this.channels = channels;
    exports._initialize?.();
    this.end = exports.__heap_base.value;
    const config = this.take(ROOM.config);
    exports.cue_default_config(config, rateHz, channels);
    this.view().setFloat64(config + CONFIG.startS, startS, true);
    this.view().setUint32(config + CONFIG.history, history ? 1 : 0, true);
    this.bytes = exports.cue_size(config);
    if (!this.bytes) throw new RangeError(`${rateHz} Hz in ${channels} channels: 22050 to 96000 Hz, 1 to 8 channels`);
    this.state = this.take(this.bytes);
    this.list = this.take(4 * channels);
    this.planes = Array.from({ length: channels }, () => this.take(4 * FRAMES));
    this.event = this.take(ROOM.event);
    this.eventBytes = exports.cue_event_size();
    this.heard = this.take(ROOM.diagnosis);
    this.text = this.take(ROOM.text);
    this.info = this.take(ROOM.info);
    /** @type {any} */
    this.file = null;
    new Uint32Array(exports.memory.buffer, this.list, channels).set(this.planes);
    this.must(exports.cue_init(this.state, this.bytes, config));
    if (voice) this.load(new Uint8Array(voice));
  }

  /** Room of some bytes in the module's memory. @param {number} bytes */
  take(bytes) {
    const at = Math.ceil(this.end / ALIGNMENT) * ALIGNMENT;
    this.end = at + bytes;
    const { memory } = this.cue;
    const missing = Math.ceil((this.end - memory.buffer.byteLength) / PAGE_BYTES);
    if (missing > 0) memory.grow(missing);
    return at;
  }

  view() {
    return new DataView(this.cue.memory.buffer);
  }

  /** Pass on a status; one below zero throws. @param {number} status */
  must(status) {
    if (status < 0) throw new Error(this.explain() || `status ${status}`);
    return status;
  }

  /** @param {Uint8Array} voice */
  load(voice) {
    const end = this.end;
    const at = this.take(voice.length);
    new Uint8Array(this.cue.memory.buffer, at, voice.length).set(voice);
    this.must(this.cue.cue_voice(this.state, at, voice.length));
    this.end = end;
  }

  /**
   * Check whose cues these are: `announcement` is a broadcaster's public file (spec/authentication.md,
   * E15); each superframe then gives an event `proof`. Throws if the file is damaged or not signed.
   * @param {ArrayBuffer} announcement @param {number} [toleranceS]
   */
  trust(announcement, toleranceS = 10) {
    const file = new Uint8Array(announcement);
    const { end } = this;
    const at = this.take(file.length);
    new Uint8Array(this.cue.memory.buffer, at, file.length).set(file);
    this.must(this.cue.cue_trust(this.state, at, file.length, toleranceS, 0, 0));
    this.end = end;
  }

  /** The next sample arrives at `utcS`, seconds since 1970, of a broadcast; without it replays go unnoticed. @param {number} utcS */
  clock(utcS) {
    this.must(this.cue.cue_clock(this.state, utcS));
  }

  /** Take one array of samples per channel, full scale 1, of any length; returns the events. @param {Float32Array[]} planes */
  push(planes) {
    /** @type {any[]} */
    const events = [];
    const { length } = planes[0];
    for (let at = 0; at < length; at += FRAMES) {
      const count = Math.min(FRAMES, length - at);
      this.planes.forEach((plane, channel) => {
        const samples = planes[Math.min(channel, planes.length - 1)].subarray(at, at + count);
        new Float32Array(this.cue.memory.buffer, plane, count).set(samples);
      });
      this.must(this.cue.cue_push_planar(this.state, this.list, count));
      this.collect(events);
    }
    return events;
  }

  /** The programme is over: returns the events that its end completes. */
  flush() {
    this.must(this.cue.cue_flush(this.state));
    return this.collect([]);
  }

  /** Take a stream file in place of sound; throws if it is damaged or of another voice. @param {ArrayBuffer} bytes */
  open(bytes) {
    const stream = new Uint8Array(bytes);
    if (stream.length > (this.file?.bytes ?? 0)) this.file = { at: this.take(stream.length), bytes: stream.length };
    this.file.bytes = stream.length;
    new Uint8Array(this.cue.memory.buffer, this.file.at, stream.length).set(stream);
    this.view().setUint32(this.info, ROOM.info, true);
    this.must(this.cue.cue_file_open(this.state, this.file.at, stream.length, this.info));
    const view = this.view();
    return {
      startS: view.getFloat64(this.info + INFO.startS, true),
      durationS: view.getFloat64(this.info + INFO.durationS, true),
      superframes: view.getUint32(this.info + INFO.superframes, true),
    };
  }

  /** The events of the next 0.64 s of the stream file; null behind its end. */
  read() {
    if (this.must(this.cue.cue_file_read(this.state, this.file.at, this.file.bytes)) !== 0) return null;
    return this.collect([]);
  }

  /** Forget the sound: the next sample has the time `startS`. @param {number} startS */
  reset(startS) {
    this.must(this.cue.cue_reset(this.state, startS));
  }

  /** @param {any[]} events */
  collect(events) {
    for (;;) {
      this.view().setUint32(this.event, this.eventBytes, true);
      if (this.must(this.cue.cue_next(this.state, this.event)) !== 0) return events;
      const view = this.view();
      const read = READERS[view.getUint32(this.event + EVENT.kind, true)];
      if (read) events.push({ timeS: view.getFloat64(this.event + EVENT.timeS, true), ...read(view, this.event + EVENT.body) });
    }
  }

  /** How reception stands: level, pilots, superframes received and failed. */
  diagnosis() {
    const { heard: at } = this;
    this.view().setUint32(at, ROOM.diagnosis, true);
    this.must(this.cue.cue_diagnose(this.state, at));
    const view = this.view();
    /** @param {number} offset */
    const count = (offset) => view.getUint32(at + offset, true);
    return {
      state: STATES[count(4)],
      heardS: view.getFloat64(at + 16, true),
      levelsDbfs: Array.from({ length: this.channels }, (_, i) => view.getFloat32(at + 24 + 4 * i, true)),
      pilots: view.getFloat32(at + 56, true),
      clockPpm: view.getFloat32(at + 60, true),
      firstLockS: view.getFloat64(at + 72, true),
      superframes: count(80), failed: count(84), secondFailed: count(88), proofs: count(96), forged: count(100),
      ageS: view.getFloat32(at + 104, true), authenticity: PROOFS[view.getUint8(at + 108)],
    };
  }

  /** The receiver's own words for the last error or for how reception stands, in English. */
  explain() {
    if (this.cue.cue_explain(this.state, this.text, ROOM.text) !== 0) return "";
    const bytes = new Uint8Array(this.cue.memory.buffer, this.text, ROOM.text);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
}

/**
 * What is read of each kind of event, by the numbers of `cue_event_kind`.
 * @type {Record<number, (view: DataView, at: number) => {kind: string}>}
 */
const READERS = {
  1: (view, at) => ({ kind: "state", state: STATES[view.getUint32(at, true)] }),
  3: (view, at) => ({ kind: "lost", count: view.getUint32(at + 12, true) }),
  5: (view, at) => ({ kind: "key", ...keyAt(view, at) }),
  6: (view, at) => ({ kind: "preview", ...keyAt(view, at) }),
  7: (view, at) => ({
    kind: "motion",
    revision: view.getUint32(at, true),
    layers: view.getUint8(at + 8),
    values: new Float32Array(view.buffer.slice(at + 12, at + 12 + 4 * view.getUint32(at + 4, true))),
  }),
  9: (view, at) => ({
    kind: "proof",
    status: PROOFS[view.getUint8(at)],
    reason: view.getUint8(at + 1),
    ageS: view.getFloat32(at + 20, true),
    of: Array.from(new Uint8Array(view.buffer, at + 2, 16), (byte) => byte.toString(16).padStart(2, "0")).join(""),
  }),
  10: (view, at) => ({ kind: "unreadable", identity: view.getUint16(at, true), version: view.getUint8(at + 2) }),
};

/** @param {DataView} view @param {number} at */
function keyAt(view, at) {
  return {
    durationS: view.getFloat64(at, true),
    shape: view.getUint8(at + 8),
    placement: PLACEMENTS[view.getUint8(at + 9)],
    final: view.getUint8(at + 10) === 1,
    previewed: view.getUint8(at + 12) === 1,
    phones: [view.getUint8(at + 13), view.getUint8(at + 14)].filter(Boolean).map((number) => PHONES[number]),
    revision: view.getUint32(at + 16, true),
  };
}
return { PHONES, Decoder };
})();

const $pieces = (() => {
/** Frames of motion, some of them shown anew by later superframes, as whole pieces for the timeline. */

const RATE_HZ = 50;
const KEPT = 12;
const MOST_FRAMES = 32;

class Pieces {
  constructor() {
    /** @type {Rows[]} */
    this.pieces = [];
    /** @type {Set<Rows>} */
    this.changed = new Set();
  }

  /** Take an event of motion. @param {{timeS: number, layers: number, values: Float32Array}} event */
  add({ timeS, layers, values }) {
    /** @param {Rows} piece */
    const at = (piece) => Math.round((timeS - piece.startS) * RATE_HZ);
    /** @param {Rows} piece */
    const fits = (piece) => at(piece) >= 0 && at(piece) <= Math.min(piece.rows.length, MOST_FRAMES - 1);
    let piece = this.pieces.find(fits);
    if (!piece) {
      piece = { startS: timeS, layers, rows: [] };
      this.pieces.push(piece);
      if (this.pieces.length > KEPT) this.pieces.shift();
    }
    piece.rows[at(piece)] = values;
    piece.layers = layers;
    this.changed.add(piece);
  }

  /** The pieces that changed since the last call, as `receiver/page/timeline.js` takes them. */
  take() {
    const out = [...this.changed].map(({ startS, layers, rows }) => {
      const width = rows[0].length;
      const frames = new Float32Array(rows.length * width);
      rows.forEach((row, i) => frames.set(row, i * width));
      return { startS, layers, rateHz: RATE_HZ, count: rows.length, width, frames, concealed: layers === 0 };
    });
    this.changed.clear();
    return out;
  }
}
return { Pieces };
})();

const $worker = (() => {
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

const { Decoder } = $decoder;
const { Pieces } = $pieces;

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
return {  };
})();

