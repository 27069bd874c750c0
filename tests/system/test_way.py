"""The whole way through the command line: subtitles in, the same keys out of a broadcast codec."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import soundfile

from cuecast.command.cli import main
from cuecast.demo.content import make_sound
from cuecast.demo.run import as_srt
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.drawing.render import read_picture
from receiver.media.sound import read_sound

pytestmark = pytest.mark.long(13)

FS = 48000
SECONDS = 9
LINES = 2

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*argv: object) -> tuple[int, str, str]:
        status = main([str(a) for a in argv])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A programme of nine seconds with its subtitles, dubbed once; its report and motion."""
    path = tmp_path_factory.mktemp("way")
    sound, subtitles = make_sound()
    sound = sound[: SECONDS * FS]
    (path / "a.srt").write_text(as_srt(subtitles[:LINES]), encoding="utf-8")
    y, x = np.mgrid[0:64, 0:96]
    pictures = [
        np.stack([x + n, y + n, x * 0 + 80], axis=2).astype(np.uint8) for n in range(25 * SECONDS)
    ]
    write_film(path / "a.mkv", sound, FS, encoder="flac", pictures=pictures)
    assert main(["synth", "--file", str(path / "a.srt"), "-o", str(path / "sent.npz")]) == 0
    dub = [
        "dub",
        path / "a.mkv",
        "--subtitles",
        path / "a.srt",
        "-o",
        path / "b.mkv",
        "--grade",
        "-1",
    ]
    assert main([*map(str, dub), "--report", str(path / "r.json")]) == 0
    return path


@pytest.mark.parametrize(
    ("file", "codec", "bit_rate"),
    [("c.mp4", "aac", 128000), ("c.ts", "mp2", 192000), ("c.mp3", "libmp3lame", 192000)],
)
def test_keys_arrive(folder: Path, run: Run, file: str, codec: str, bit_rate: int) -> None:
    if file == "c.mp3":
        write_film(folder / file, *read_sound(folder / "b.mkv"), encoder=codec, bit_rate=bit_rate)
    else:
        rewrite_sound(
            folder / "b.mkv", folder / file, lambda *_: Unchanged(), codec=codec, bit_rate=bit_rate
        )
    status, out, _ = run("receive", folder / file, "--json", "-o", folder / f"{file}.npz")
    assert status == 0
    found = json.loads(out)
    assert found["superframes"]["lost"] == 0
    assert found["superframes"]["received"] >= 9
    assert found["tune_in_s"] < 3
    report = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    keys = [[(k["shape"], k["placement"]) for k in d["keys"]] for d in (report, found)]
    assert keys[0][-len(keys[1]) :] == keys[1]
    assert found["voice"] == report["voice"]
    status, out, _ = run("compare", folder / "sent.npz", folder / f"{file}.npz", "--json")
    assert status == 0
    alike = json.loads(out)
    assert alike["keys_correct"] == alike["keys_total"] > 10
    assert abs(alike["offset_s"]) < 0.033


def test_report(folder: Path, run: Run) -> None:
    report = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    assert report["duration_s"] == pytest.approx(SECONDS, abs=0.05)
    assert report["superframes"] >= 9
    audio = report["carriers"]["audio"]
    assert audio["net_bps"] >= 300
    assert audio["gross_bps"] > audio["net_bps"]
    assert audio["odg"] > -2
    status, out, _ = run("keys", "--file", folder / "a.srt", "--json")
    assert (status, json.loads(out)) == (0, report["keys"])


@pytest.mark.parametrize("start", [0.77, 2.0])
def test_tuning_in_later(folder: Path, run: Run, start: float) -> None:
    motion = folder / "late.npz"
    status, out, _ = run("receive", folder / "b.mkv", "--json", "--start", start, "-o", motion)
    found = json.loads(out)
    assert status == 0
    assert found["tune_in_s"] < 3
    assert found["superframes"]["lost"] == 0
    status, out, _ = run("compare", folder / "sent.npz", motion, "--json")
    alike = json.loads(out)
    assert status == 0
    assert alike["keys_correct"] == alike["keys_total"] > 5


def test_from_a_pipe(folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    with (folder / "b.mkv").open("rb") as file:
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=file))
        status, out, _ = run("receive", "-", "--json")
    assert status == 0
    assert json.loads(out)["superframes"]["received"] >= 10


@pytest.mark.parametrize("suffix", [".trc", ".csv", ".c3d"])
def test_received_markers(folder: Path, run: Run, suffix: str) -> None:
    if suffix == ".c3d":
        pytest.importorskip("ezc3d", reason="needs the extra `c3d`")
    target = folder / f"markers{suffix}"
    assert run("receive", folder / "b.mkv", "--sound-only", "--markers", target)[0] == 0
    assert target.stat().st_size > 10_000


def test_picture_of_a_chosen_size_and_side(folder: Path, run: Run) -> None:
    pictures = []
    for name, options in (("right", ()), ("left", ("--mirror",))):
        target = folder / f"{name}.png"
        assert (
            run("render", folder / "sent.npz", "-o", target, "--size", "160x180", *options)[0] == 0
        )
        pictures.append(read_picture(target).astype(int))
    assert pictures[0].shape == (180, 160, 3)
    assert np.array_equal(pictures[0], pictures[1][:, ::-1])
    assert not np.array_equal(pictures[0], pictures[1])
    assert run("render", folder / "sent.npz", "-o", folder / "x.png", "--size", "big")[0] == 2


def test_dubbing_a_given_motion(folder: Path, run: Run) -> None:
    target = folder / "m.mkv"
    status, out, _ = run(
        "dub", folder / "a.mkv", "--motion", folder / "sent.npz", "-o", target, "--json",
        "--no-grade", "--no-read-back",
    )  # fmt: skip
    assert status == 0
    assert "odg" not in json.loads(out)["carriers"]["audio"]
    status, out, _ = run("receive", target, "--json")
    report = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    assert [k["phones"] for k in json.loads(out)["keys"]] == [k["phones"] for k in report["keys"]]


def test_bit_stream_alone(folder: Path, run: Run) -> None:
    stream, back = folder / "s.cue", folder / "s.npz"
    assert run("encode", folder / "sent.npz", "-o", stream)[0] == 0
    status, out, _ = run("inspect", stream, "--json")
    assert status == 0
    assert json.loads(out)
    assert run("inspect", stream)[1].strip()
    assert run("decode", stream, "-o", back)[0] == 0
    status, out, _ = run("compare", folder / "sent.npz", back, "--json")
    alike = json.loads(out)
    assert (status, alike["keys_correct"]) == (0, alike["keys_total"])


def test_compare_tells_a_mismatch(folder: Path, run: Run) -> None:
    other = folder / "other.npz"
    assert run("synth", "Tout autre chose, dit le vieux monsieur en riant.", "-o", other)[0] == 0
    status, out, _ = run("compare", folder / "sent.npz", other, "--json")
    assert status == 1
    assert json.loads(out)["keys_correct"] < json.loads(out)["keys_total"]
    status, _, _ = run("compare", folder / "sent.npz", folder / "sent.npz", "--limit", 0.01)
    assert status == 0


def test_unmarked_programme_is_a_result(folder: Path, run: Run) -> None:
    status, out, err = run("receive", folder / "a.mkv", "--json")
    assert (status, err) == (1, "")
    assert json.loads(out)["superframes"] == {"received": 0, "lost": 0}


def sound_file(path: Path, x: np.ndarray[Any, Any], fs: int) -> Path:
    soundfile.write(path, x, fs)
    return path


UNUSABLE = ["empty", "nothing", "text", "folder", "truncated", "8 kHz", "7 channels", "moment"]


@pytest.mark.parametrize("what", UNUSABLE)
@pytest.mark.parametrize("verb", ["dub", "receive"])
def test_unusable_programmes(folder: Path, run: Run, tmp_path: Path, verb: str, what: str) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, (2 * FS, 1))
    bad = tmp_path / "bad.wav"
    match what:
        case "empty":
            bad.touch()
        case "text":
            bad.write_text("not a film at all\n" * 100, encoding="utf-8")
        case "folder":
            bad.mkdir()
        case "truncated":
            bad = tmp_path / "bad.mkv"
            data = (folder / "a.mkv").read_bytes()
            bad.write_bytes(data[: len(data) // 2])
        case "8 kHz":
            sound_file(bad, noise[:16000], 8000)
        case "7 channels":
            sound_file(bad, np.repeat(noise, 7, axis=1), FS)
        case "moment":
            sound_file(bad, noise[:5000], FS)
    argv = [verb, bad]
    if verb == "dub":
        argv += ["--subtitles", folder / "a.srt", "-o", tmp_path / "out.wav"]
    status, out, err = run(*argv, "--json")
    if (verb, what) == ("receive", "moment"):
        assert status == 1
        return
    assert status == 3
    if (verb, what) == ("receive", "truncated"):
        assert json.loads(out)  # what the rest of the file held
    else:
        assert out == ""
    assert err.startswith(f"cuecast: {bad}: ")
    assert err.count("\n") == 1
    assert not [p for p in tmp_path.iterdir() if p != bad]


def test_silence(folder: Path, run: Run, tmp_path: Path) -> None:
    silent = sound_file(tmp_path / "silent.wav", np.zeros((3 * FS, 2)), FS)
    status, _, err = run("dub", silent, "--subtitles", folder / "a.srt", "-o", tmp_path / "o.wav")
    assert (status, list(tmp_path.iterdir())) == (3, [silent])
    assert err == f"cuecast: {silent}: the sound is silent and cannot carry a cuer\n"
    status, out, err = run("receive", silent, "--json")
    assert (status, err) == (1, "")
    assert json.loads(out)["carriers"]["audio"]["locked"] is False


def test_json_has_no_foreign_numbers(folder: Path, run: Run) -> None:
    def numbers(value: Any) -> list[float]:
        if isinstance(value, dict):
            value = list(value.values())
        if isinstance(value, list):
            return [n for item in value for n in numbers(item)]
        return [value] if isinstance(value, float) else []

    for argv in (["receive", folder / "a.mkv"], ["receive", folder / "b.mkv"]):
        assert all(map(math.isfinite, numbers(json.loads(run(*argv, "--json")[1]))))


def test_usage_of_dub(folder: Path, run: Run) -> None:
    base = ["dub", folder / "a.mkv", "-o", folder / "never.mkv"]
    assert run(*base)[0] == 3  # nor does the programme have subtitles of its own
    status, _, err = run(*base, "--subtitles", folder / "a.srt", "--carriers", "smoke")
    assert status == 2
    assert "no carrier called 'smoke'" in err
    assert run(*base, "--subtitles", folder / "missing.srt")[0] == 3
    assert run(*base, "--motion", folder / "a.srt")[0] == 3
    assert run(*base, "--subtitles", folder / "a.srt", "--track", "4")[0] == 3
    assert run(*base, "--subtitles", folder / "a.srt", "--voice", "nobody")[0] == 3
    assert not (folder / "never.mkv").exists()
