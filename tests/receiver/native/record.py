"""The figures of the receiver in C: parity with Python, speed, first lock, size.

``python -m tests.receiver.native.record docs/records/receiver.json`` writes the record; without a
path it prints the rows only. Speeds are seconds of sound per second of processor time.
"""

import gzip
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from codec.cuer.voice import load_voice
from cuecast.evaluate.records import make_record
from receiver.export.device_voice import device_voice
from receiver.web.build import DIST, WASM
from tests.receiver.native.building import built
from tests.receiver.native.parity import EXCERPTS, FOLDER, coded, compare
from tests.receiver.native.test_hearing import FS, Sound, hear, payload
from watermark import AudioEmbedder

CLIPS = ("film_mix", "pop_vocal", "speech_fr_m_lv")
CHAIN = ("aac", 128_000)
SECONDS = 36
TUNE_INS = 8
"""Places of each clip at which a viewer tunes in, 3 s and a fraction of a superframe apart."""

NODE = """
import { readFileSync } from "node:fs";
import { Decoder } from "DIST/decoder.js";
const [module, voice] = ["DIST/cuecast.wasm", "voice.bin"].map((name) => readFileSync(name));
const decoder = await Decoder.create(module, voice, { rateHz: 48000, channels: 2 });
const { buffer, byteOffset, length } = readFileSync("sound.f32");
const x = new Float32Array(buffer, byteOffset, length / 4);
const planes = [0, 1].map((c) => x.filter((_, i) => i % 2 === c));
const start = process.cpuUsage();
for (let at = 0; at < planes[0].length; at += 4800)
  decoder.push(planes.map((plane) => plane.subarray(at, at + 4800)));
console.log(JSON.stringify({ bytes: decoder.bytes, spent: process.cpuUsage(start).user / 1e6 }));
"""

Row = dict[str, Any]


def clip(name: str) -> Sound:
    """Return the first seconds of a clip."""
    x, _ = soundfile.read(FOLDER / f"{name}.flac", SECONDS * FS, dtype="float32", always_2d=True)
    return np.repeat(x, 2, axis=1) if x.shape[1] == 1 else np.asarray(x)


def marked(x: Sound) -> Sound:
    """Return a clip with a mark of the profile `standard`, through AAC."""
    embedder = AudioEmbedder(FS, 2, payload("standard"), profile="standard")
    return coded(np.concatenate([embedder.process(x), embedder.flush()]), *CHAIN)


def native_speed(x: Sound, voice: Path) -> float:
    """Return how many times faster than real time the library is."""
    done = hear(x, FS, "--time", "--voice", str(voice))[-1]
    return len(x) / FS / float(done["processor_s"])


def node_speed(x: Sound, voice: Path) -> tuple[float, int]:
    """Return the module's speed in node, and the bytes of its state."""
    folder = voice.parent
    node = shutil.which("node", path=Path(sys.executable).parent) or "node"
    (folder / "run.mjs").write_text(NODE.replace("DIST", DIST.as_posix()), encoding="utf-8")
    (folder / "sound.f32").write_bytes(np.ascontiguousarray(x, dtype="<f4").tobytes())
    done = subprocess.run([node, "run.mjs"], cwd=folder, capture_output=True, check=True)
    found = json.loads(done.stdout)
    return len(x) / FS / float(found["spent"]), int(found["bytes"])


def first_locks(x: Sound) -> list[float]:
    """Return the seconds from tuning in to the first lock at several places; 99 for none."""
    starts = [int((3 + 3.08 * i) * FS) for i in range(TUNE_INS)]
    found = [float(hear(x[at : at + 6 * FS])[-1]["first_lock_s"]) for at in starts]
    return [lock if lock >= 0 else 99.0 for lock in found]


def figures() -> Row:
    """Measure speed, first lock and sizes."""
    built("cue_dec")
    with tempfile.TemporaryDirectory() as name:
        voice = Path(name) / "voice.bin"
        voice.write_bytes(device_voice(load_voice()))
        plain = [clip(name) for name in CLIPS]
        carrying = [marked(x) for x in plain]
        locks = [lock for x in carrying for lock in first_locks(x)]
        module = [node_speed(x, voice) for x in carrying]
        speeds = {
            "native_tracking": [native_speed(x, voice) for x in carrying],
            "native_searching": [native_speed(x, voice) for x in plain],
            "node_tracking": [speed for speed, _ in module],
            "node_searching": [node_speed(x, voice)[0] for x in plain],
        }
        return {
            "part": "cost",
            **{what: round(statistics.median(found), 1) for what, found in speeds.items()},
            "state_bytes": module[0][1],
            "tune_ins": len(locks),
            "first_lock_median_s": round(statistics.median(locks), 2),
            "first_lock_most_s": round(max(locks), 2),
            "module_bytes": len(gzip.compress(WASM.read_bytes(), 9, mtime=0)),
            "voice_bytes": len(gzip.compress(voice.read_bytes(), 9, mtime=0)),
        }


def main(path: Path | None) -> None:
    """Measure everything; write a record where a path is given."""
    rows: list[Row] = [figures()]
    print(json.dumps(rows[0]), flush=True)
    for name, at_s in EXCERPTS:
        native, python, differing = compare(name, at_s)
        counts = {"native": native, "python": python, "differing": "; ".join(differing)}
        rows.append({"part": "parity", "clip": name, "at_s": at_s, **counts})
        print(json.dumps(rows[-1]), flush=True)
    total = {key: sum(row[key] for row in rows[1:]) for key in ("native", "python")}
    rows.append({"part": "parity", "clip": "all", "at_s": "", **total, "differing": ""})
    print(json.dumps(rows[-1]), flush=True)
    if path is not None:
        document = make_record("receiver", (), rows, seed=0, clips=FOLDER)
        document["command"] = "python -m tests.receiver.native.record docs/records/receiver.json"
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
