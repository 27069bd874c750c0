"""Show the effect of a constant of the embedder: grade, margins and losses with other values.

In: ``NAME=VALUE`` for constants of `watermark.audio.embed` (codec_loop, embedder,
level_control), and clips; out: a line for each clip as shipped, and one for each changed constant.
A constant without an effect here deserves a round value, or none.
Run: ``python -m tests.bench.level_constants MARGIN=1.9 SPOILT=1 --clips CLIP ...``; with
``--through mp2:192k+aac:128k`` for other coders, ``--channels`` to receive as well.
"""

import argparse
import time
from pathlib import Path
from types import ModuleType

import numpy as np

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.sound_channels import find_channel
from receiver.media.sound import read_sound
from watermark.audio.embed import codec_loop, embedder, level_control
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import find_profile
from watermark.link.superframe import SUPERFRAME_S

MODULES: tuple[ModuleType, ...] = (codec_loop, embedder, level_control)
BLOCK = 4800


def main() -> None:
    """Print a line for each clip and value."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("changes", nargs="*", metavar="NAME=VALUE")
    parser.add_argument("--clips", nargs="+", type=Path, required=True)
    parser.add_argument("--profile", default="standard")
    parser.add_argument("--through")
    parser.add_argument("--channels", nargs="*", default=[])
    parser.add_argument("--seconds", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    for change in ("", *chosen.changes):
        name, _, value = change.partition("=")
        before = set_constant(name, float(value)) if name else []
        for clip in chosen.clips:
            print(f"{change or 'as shipped':20} {clip.stem:18} {figures(clip, chosen)}", flush=True)
        for module, old in before:
            setattr(module, name, old)


def set_constant(name: str, value: float) -> list[tuple[ModuleType, float]]:
    """Set a constant in every module that has it; return those modules and their values."""
    before = [(module, getattr(module, name)) for module in MODULES if hasattr(module, name)]
    if not before:
        raise SystemExit(f"no constant {name} in the embedder")
    for module, _ in before:
        setattr(module, name, value)
    return before


def figures(clip: Path, chosen: argparse.Namespace) -> str:
    """Grade, margins, processor time and losses of a clip."""
    sound, fs = read_sound(clip)
    sound = sound[: round(chosen.seconds * fs)]
    profile, rng = find_profile(chosen.profile), np.random.default_rng(chosen.seed)
    whole = int(len(sound) / fs / SUPERFRAME_S - 0.02)
    sent = [(rng.bytes(profile.l0_bytes), rng.bytes(profile.l1_bytes)) for _ in range(whole + 3)]
    begin = time.process_time()
    marker = AudioEmbedder(
        fs,
        sound.shape[1],
        sent.__getitem__,
        profile=profile.name,
        rehearsal=make_rehearsal(profile, 0, chosen.through),
    )
    parts = [marker.process(sound[i : i + BLOCK]) for i in range(0, len(sound), BLOCK)]
    marked = np.concatenate([*parts, marker.flush()])
    cost = (time.process_time() - begin) / len(sound) * fs
    margins = [one.margin for one in marker.margins() if one.number < whole] or [0.0]
    low, tenth, median = np.quantile(margins, [0.0, 0.1, 0.5])
    line = f"grade {marker.report().odg:+.3f} margin {low:.2f} {tenth:.2f} {median:.2f}"
    for name in chosen.channels:
        heard = find_channel(name)(marked, fs)
        receiver = AudioReceiver(fs, heard.shape[1])
        found = [receiver.process(heard[i : i + BLOCK]) for i in range(0, len(heard), BLOCK)]
        came = {(s.l0, s.l1) for part in (*found, receiver.flush()) for s in part}
        line += f" {name} {sum(one not in came for one in sent[:whole])} of {whole} lost"
    return f"{line} cost {cost:.2f}"


if __name__ == "__main__":
    main()
