"""What dubbing and receiving a programme cost, beside FFmpeg's AAC encode of its sound in one run.

In: nothing; a programme of announcements and music is made. Out: processor times of whole commands,
imports included, as multiples of that encode's, and their memory; how fast the first minute of
unmarked sound is searched, with the start of a process and without. Run:
``python -m tests.bench.sender_cost``; ratios of short programmes are higher than those of long
ones, since imports weigh more.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.media.film import write_film

ENCODE = """
import sys, time
import av
source, seconds = sys.argv[1], []
for _ in range(3):
    with av.open(source) as programme:
        frames = list(programme.decode(audio=0))
    coder = av.CodecContext.create("aac", "w")
    coder.sample_rate, coder.layout, coder.format, coder.bit_rate = 48000, "stereo", "fltp", 128000
    towards = av.AudioResampler("fltp", "stereo", 48000, frame_size=1024)
    ready = [one for frame in frames for one in towards.resample(frame)]
    begun = time.process_time()
    for frame in ready:
        coder.encode(frame)
    seconds.append(time.process_time() - begun)
print(min(seconds))
"""


SEARCH = "first minute of unmarked sound"
MINUTE_S = 60
"""Length of the unmarked sound that is searched."""


AGAIN = """
import contextlib, io, sys, time
from cuecast.command.cli import main
for _ in range(2):
    begun = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(sys.argv[1:])
print(time.process_time() - begun)
"""
"""Runs a command twice in one process and prints the second one's processor time in seconds."""


def make_programme(folder: Path, seconds: int) -> None:
    """Write the programme and its subtitles."""
    sound, lines = make_sound()
    length = len(sound) // FS
    rounds = -(-seconds // length)
    whole = np.tile(sound[: length * FS], (rounds, 1))[: seconds * FS]
    write_film(folder / "a.mka", whole, FS, encoder="flac", pictures=iter(()))
    write_film(folder / "u.mka", whole[: MINUTE_S * FS], FS, encoder="flac", pictures=iter(()))
    subtitles = [
        replace(one, start_s=one.start_s + r * length, end_s=one.end_s + r * length)
        for r in range(rounds)
        for one in lines
        if one.end_s + r * length < seconds
    ]
    (folder / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")


ALONE = """
import resource, subprocess, sys
with open("log", "wb") as log:
    status = subprocess.call(sys.argv[1:], stdout=log, stderr=log)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(status, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""
"""Runs a command and prints its status, processor time in seconds and memory in MB: the memory of
who starts a process counts for that process."""


def cost_of(folder: Path, *command: str) -> tuple[float, float]:
    """Processor time of a command in seconds, and its largest memory in MB."""
    # Installed programs have their modules compiled.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-c", ALONE, sys.executable, *command],
        cwd=folder,
        env=environment,
        capture_output=True,
        check=True,
    )
    status, seconds, megabytes = map(float, done.stdout.split())
    log = (folder / "log").read_text(errors="replace")
    if status not in (0, 1) or "Traceback" in log:
        raise SystemExit(log[-2000:])
    return seconds, megabytes


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=600)
    seconds = parser.parse_args().seconds
    cuecast = ["-m", "cuecast"]
    dub = [*cuecast, "dub", "a.mka", "--subtitles", "a.srt"]
    commands = {
        "keys of a word": [*cuecast, "keys", "un mot"],
        "keys of the programme": [*cuecast, "keys", "--file", "a.srt"],
        "dub": [*dub, "-o", "b.mka"],
        "dub without rehearsal, grade and read-back":
            [*dub, "-o", "c.mka", "--through", "none", "--no-read-back", "--no-grade"],
        "receive": [*cuecast, "receive", "b.mka", "--json"],
        SEARCH: [*cuecast, "receive", "u.mka", "--json"],
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_programme(folder, seconds)
        encode = subprocess.run(
            [sys.executable, "-c", ENCODE, "a.mka"], cwd=folder, capture_output=True, check=True
        )
        unit = float(encode.stdout)
        print(f"AAC encode of {seconds} s: {unit:.2f} s of processor time")
        for title, command in commands.items():
            spent, megabytes = cost_of(folder, *command)
            speed = f", {MINUTE_S / spent:.1f} times real time" if title == SEARCH else ""
            print(
                f"{title}: {spent:.2f} s, {spent / unit:.2f} encodes, {megabytes:.0f} MB{speed}",
                flush=True,
            )
        again = subprocess.run(
            [sys.executable, "-c", AGAIN, *commands[SEARCH][2:]],
            cwd=folder, capture_output=True, check=True,
        )  # fmt: skip
        spent = float(again.stdout)
        print(f"{SEARCH}, process running: {spent:.2f} s, {MINUTE_S / spent:.1f} times real time")


if __name__ == "__main__":
    main()
