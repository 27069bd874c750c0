// cue_dec.mjs - raw sound on stdin, superframes as JSON lines on stdout, by the WebAssembly module.
//
//     node cue_dec.mjs MODULE [RATE] [CHANNELS] < sound.f32
//
// The module imports nothing. Its memory from __heap_base on is the host's: the receiver's block,
// then one array per channel, then an event. Offsets are those of cuecast.h in wasm32.
import { readFileSync } from "node:fs";

const [module, rate = "48000", channels = "2"] = process.argv.slice(2);
const FRAMES = 4800;
const BLOCK = 16; // alignment of every part
const EVENT = { size: 0, kind: 4, time: 8, superframe: 16 };
const SUPERFRAME = { late: 31, l0Bytes: 29, l1Bytes: 30, profile: 28, l0: 40, l1: 60 };

const { instance } = await WebAssembly.instantiate(readFileSync(module), {});
const cue = instance.exports;
cue._initialize?.();
const count = Number(channels);
let end = cue.__heap_base.value;
function take(bytes) {
  const at = Math.ceil(end / BLOCK) * BLOCK;
  end = at + bytes;
  const missing = Math.ceil((end - cue.memory.buffer.byteLength) / 65536);
  if (missing > 0) cue.memory.grow(missing);
  return at;
}
function must(status, what) {
  if (status < 0) throw new Error(`${what}: status ${status}`);
  return status;
}

const config = take(64);
cue.cue_default_config(config, Number(rate), count);
const size = cue.cue_size(config);
if (!size) throw new Error(`rate ${rate} or channels ${channels} outside of the limits`);
const state = take(size);
const list = take(4 * count);
const planes = Array.from({ length: count }, () => take(4 * FRAMES));
const event = take(2048);
must(cue.cue_init(state, size, config), "cue_init");
new Uint32Array(cue.memory.buffer, list, count).set(planes);

const eventBytes = Number(cue.cue_event_size());
function collect() {
  const view = new DataView(cue.memory.buffer);
  const hex = (at, n) => Buffer.from(cue.memory.buffer, at, n).toString("hex");
  for (;;) {
    view.setUint32(event + EVENT.size, eventBytes, true);
    if (must(cue.cue_next(state, event), "cue_next") !== 0) return;
    if (view.getUint32(event + EVENT.kind, true) !== 2) continue;
    const s = event + EVENT.superframe;
    const l1 = view.getUint8(s + SUPERFRAME.l1Bytes);
    console.log(
      JSON.stringify({
        kind: "superframe",
        time_s: view.getFloat64(event + EVENT.time, true),
        profile: view.getUint8(s + SUPERFRAME.profile),
        late: view.getUint8(s + SUPERFRAME.late) === 1,
        l0: hex(s + SUPERFRAME.l0, view.getUint8(s + SUPERFRAME.l0Bytes)),
        l1: l1 ? hex(s + SUPERFRAME.l1, l1) : null,
      }),
    );
  }
}

const bytes = readFileSync(0);
const sound = new Float32Array(bytes.buffer, bytes.byteOffset, Math.floor(bytes.length / 4));
const start = process.cpuUsage();
const total = Math.floor(sound.length / count);
for (let at = 0; at < total; at += FRAMES) {
  const n = Math.min(FRAMES, total - at);
  planes.forEach((plane, channel) => {
    const out = new Float32Array(cue.memory.buffer, plane, n);
    for (let i = 0; i < n; i++) out[i] = sound[(at + i) * count + channel];
  });
  must(cue.cue_push_planar(state, list, n), "cue_push_planar");
  collect();
}
must(cue.cue_flush(state), "cue_flush");
collect();
const user = process.cpuUsage(start).user / 1e6;
console.log(JSON.stringify({ kind: "done", state_bytes: size, processor_s: user, first_lock_s: -1 }));
