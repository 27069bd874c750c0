"""A programme over UDP with all that goes wrong in an hour, and what became of its superframes.

In: nothing; a stream of announcements and music is made, with two changes of format. Out: JSON with
superframes received and lost by cause, unmarked seconds by cause, delay, other streams, events and
the playout's own figures; then a sentence. The bench stands for the service manager. Linux only.
Run: ``python -m tests.bench.hour_on_air --minutes 60``.
"""

import argparse
import contextlib
import ctypes
import json
import os
import pickle
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.live.lines import Input
from cuecast.live.packets import clock_of, pid_of
from cuecast.live.playout import DELAY_S
from cuecast.media.tables import NULL_PID, PACKET
from tests.bench.on_air_account import Account, Event, account

SOUND_PID = 257
FORMS = (("aac", "stereo", 160_000), ("mp2", "stereo", 192_000), ("aac", "mono", 96_000))
EVENTS = {
    "killed": (0.2, "worker killed"),
    "stopped": (0.5, "worker stopped for 5 s"),
    "main": (0.8, "main killed"),
}
"""At which part of the programme each event happens."""

EFFECT_S = -DELAY_S - 1.5, 3.0
"""The part of the programme that an event can harm, from its moment: what was on its way, and a
process that takes over."""

NICE = -10
"""Priority of the playout, for that of deploy/cuecast-playout@.service; needs root."""

STEP_S, LATE_S = 0.04, 0.7
"""Delay counts as constant within the first; packets later than the second count as missing."""

_PR_SET_CHILD_SUBREAPER = 36
"""Of Linux: processes whose parent died become children of this process."""

PORT = 9000 + os.getpid() % 1000


@dataclass
class Course:
    """What was sent, lost and received, with times of `time.monotonic`."""

    sent: list[tuple[float, bytes]] = field(default_factory=list)
    lost: int = 0
    came: list[tuple[float, bytes]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)
    stopped_with: int = -1


def write_stream(folder: Path, seconds: int) -> bytes:
    """Write the programme in three forms, its clock running through, and its subtitles."""
    sound, lines = make_sound()
    length = len(sound) // FS
    rounds = range(-(-seconds // length))
    subtitles = [
        replace(one, start_s=one.start_s + r * length, end_s=one.end_s + r * length)
        for r in rounds
        for one in lines
    ]
    (folder / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")
    data = b""
    for number, (codec, layout, rate) in enumerate(FORMS):
        begin, end = (25 * seconds * n // len(FORMS) for n in (number, number + 1))
        path = folder / f"{number}.ts"
        options = {"tables_version": str(number)}
        with av.open(str(path), "w", format="mpegts", options=options) as out:
            picture: Any = out.add_stream("mpeg2video", rate=25)
            picture.width, picture.height, picture.pix_fmt = 64, 64, "yuv420p"
            heard: Any = out.add_stream(codec, rate=FS)
            heard.layout, heard.bit_rate = layout, rate
            for n in range(begin, end):
                # Luma above chroma, as libav lays them out.
                frame = av.VideoFrame.from_ndarray(
                    np.full((96, 64), 16 + n % 220, np.uint8), format="yuv420p"
                )
                frame.pts, frame.time_base = n, Fraction(1, 25)
                out.mux(picture.encode(frame))
                at = n * FS // 25 % (length * FS)
                part = sound[at : at + FS // 25]
                part = part if layout == "stereo" else part.mean(axis=1, keepdims=True)
                block = (
                    av.AudioFrame.from_ndarray(np.ascontiguousarray(part.T), "fltp", layout)
                    if codec == "aac"
                    else av.AudioFrame.from_ndarray(
                        (part * 32767).astype(np.int16).reshape(1, -1), "s16", layout
                    )
                )
                block.sample_rate, block.time_base = FS, Fraction(1, FS)
                block.pts = n * FS // 25
                out.mux(heard.encode(block))
            out.mux(picture.encode(None))
            out.mux(heard.encode(None))
        data += path.read_bytes()
    return data


def paced(data: bytes) -> list[tuple[float, bytes]]:
    """Return datagrams with the second at which each is due, by the stream's clock."""
    packets = [data[at : at + PACKET] for at in range(0, len(data), PACKET)]
    known = [(n, c) for n, p in enumerate(packets) if (c := clock_of(p)) is not None]
    numbers, clocks = (np.array(x) for x in zip(*known, strict=True))
    due = np.interp(np.arange(len(packets)), numbers, np.maximum.accumulate(clocks - clocks[0]))
    return [(float(due[n]), b"".join(packets[n : n + 7])) for n in range(0, len(packets), 7)]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Service:
    """The playout as a service manager runs it: a service lives as long as any process of it.

    So does systemd with the unit's ExitType=cgroup. Processes without a parent become this one's.
    """

    def __init__(self, source: int, target: int, folder: Path, more: list[str]) -> None:
        self._command = [
            sys.executable, "-m", "cuecast", "playout", f"udp://127.0.0.1:{source}",
            f"udp://127.0.0.1:{target}", "--subtitles", str(folder / "a.srt"), "--port", str(PORT),
            *more,
        ]  # fmt: skip
        self._log = (folder / "log.txt").open("a")
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(self._command, stderr=self._log, start_new_session=True)
        with contextlib.suppress(OSError):  # Linux weighs sessions against each other by this one
            Path(f"/proc/{self.process.pid}/autogroup").write_text(str(NICE))

    def _session(self) -> dict[int, bytes]:
        """Processes of the service, oldest first, and their command lines."""
        found: dict[int, tuple[int, bytes]] = {}
        for one in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                fields = (one / "stat").read_text().rpartition(")")[2].split()
                if int(fields[3]) == self.process.pid and fields[0] != "Z":
                    found[int(one.name)] = int(fields[19]), (one / "cmdline").read_bytes()
        oldest_first = sorted(found, key=lambda pid: found[pid][0])  # numbers of processes wrap
        return {pid: found[pid][1] for pid in oldest_first}

    def active(self) -> int:
        """Process of the playout that has the programme: the oldest one."""
        return next(pid for pid, line in self._session().items() if b"playout" in line)

    def workers(self) -> list[int]:
        """Processes that the playout started by Python, the marking one first."""
        return [pid for pid, line in self._session().items() if b"spawn_main" in line]

    def end(self) -> int:
        """Ask all processes to end, wait, and return the exit status of the playout."""
        active = self.active()
        os.killpg(self.process.pid, signal.SIGTERM)
        while self._session():
            time.sleep(0.1)
        self._log.close()
        status = self.process.wait()
        with contextlib.suppress(ChildProcessError):
            while True:
                pid, how = os.waitpid(-1, os.WNOHANG)
                if pid == active:
                    status = os.waitstatus_to_exitcode(how)
                if not pid:
                    break
        return status

    def health(self) -> dict[str, Any]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/health", timeout=5) as answer:
                return dict(json.loads(answer.read()))
        except urllib.error.HTTPError as error:
            return dict(json.loads(error.read()))
        except OSError:
            return {"state": "none"}

    def figures(self) -> dict[str, float]:
        while self.health()["state"] == "none" and self._session():
            time.sleep(0.1)
        with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/metrics", timeout=5) as answer:
            text = answer.read().decode()
        found = re.findall(r"^cuecast_(\w+) (\S+)$", text, re.M)
        return {name: float(value) for name, value in found}

    def wait(self) -> None:
        while self.health()["state"] not in ("ready", "marked"):
            if not self._session():
                raise OSError("the playout ended")
            time.sleep(0.5)


def run(folder: Path, options: argparse.Namespace) -> tuple[Course, list[tuple[float, bytes]]]:
    """Play the programme through the playout while things go wrong."""
    seconds = int(60 * options.minutes)
    datagrams = paced(write_stream(folder, seconds))
    source, target = free_port(), free_port()
    course, rng, over = Course(), random.Random(options.seed), threading.Event()
    back = Input(f"udp://127.0.0.1:{target}")

    def receive() -> None:
        while not over.is_set():
            course.came.extend(back.take(0.5))

    threading.Thread(target=receive, daemon=True).start()
    service = Service(source, target, folder, options.more)
    service.wait()
    while options.events and not service.figures()["successor_stands_by"]:
        time.sleep(0.5)
    note(f"the playout is ready; {seconds} s follow")
    plan = [EVENTS[name] for name in EVENTS if name in options.events]
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    begin = time.monotonic()
    for due, data in datagrams:
        wait_s = begin + due - time.monotonic()
        if wait_s > 0:
            time.sleep(wait_s)
        if plan and due >= plan[0][0] * seconds:
            happen(plan.pop(0)[1], due, service, course)
        if rng.random() < options.loss:
            course.lost += 1
            continue
        course.sent.append((time.monotonic(), data))
        line.sendto(data, ("127.0.0.1", source))
    time.sleep(1.0)
    course.figures = service.figures()
    course.stopped_with = service.end()
    time.sleep(1.0)
    over.set()
    for n in range(1, len(FORMS)):
        at_s = seconds * n / len(FORMS)
        course.events.append(Event("change of format", (at_s - 0.7, at_s + 0.7)))
    return course, datagrams


def happen(name: str, due: float, service: Service, course: Course) -> None:
    """Let an event happen."""
    note(f"{due:.1f} s: {name}")
    if name == "worker killed":
        os.kill(service.workers()[0], signal.SIGKILL)
    elif name.startswith("worker stopped"):
        stopped = service.workers()[0]
        os.kill(stopped, signal.SIGSTOP)
        threading.Timer(5.0, resume, [stopped]).start()
    else:
        os.kill(service.active(), signal.SIGKILL)
    course.events.append(Event(name, (due + EFFECT_S[0], due + EFFECT_S[1])))


def resume(process: int) -> None:
    try:
        os.kill(process, signal.SIGCONT)
    except ProcessLookupError:  # another one took its place
        return


def note(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def packets_of(pieces: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
    return [(t, d[at : at + PACKET]) for t, d in pieces for at in range(0, len(d), PACKET)]


def follow(sent: list[tuple[float, bytes]], came: list[tuple[float, bytes]]) -> np.ndarray:
    """Return the delays of the other streams' packets, seconds; NaN for those that did not come.

    Packets of a table are the same every 1.6 s: each is sought where it is due, not everywhere.
    """
    delays, at = [], 0
    for sent_s, packet in sent:
        while at < len(came) and came[at][0] < sent_s + DELAY_S - LATE_S:
            at += 1
        n = at
        delays.append(np.nan)
        while n < len(came) and came[n][0] < sent_s + DELAY_S + LATE_S:
            if came[n][1] == packet:
                delays[-1] = came[n][0] - sent_s
                break
            n += 1
    return np.array(delays)


def others(pieces: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
    return [(t, p) for t, p in packets_of(pieces) if pid_of(p) not in (SOUND_PID, NULL_PID)]


def report(course: Course, datagrams: list[tuple[float, bytes]]) -> dict[str, Any]:
    """Return the figures of a run."""
    meant, reached, left = (
        [packet for _, packet in packets_of(x)] for x in (datagrams, course.sent, course.came)
    )
    found = account(meant, reached, left, course.events)
    sent = others(course.sent)
    delays = follow(sent, others(course.came))
    missing = np.isnan(delays)
    at_s = [round(sent[n][0] - course.sent[0][0], 1) for n in np.flatnonzero(missing)]
    delays = delays[~missing]
    median_s = float(np.median(delays)) if len(delays) else 0.0
    return {
        "programme_s": datagrams[-1][0],
        "datagrams": {"sent": len(course.sent), "lost": course.lost},
        "superframes": superframes(found),
        "unmarked_s": {k: round(v, 2) for k, v in found.unmarked_s.items()},
        "other_packets": {
            "sent": len(sent),
            "missing": len(at_s),
            "missing_at_s": sorted(set(at_s)),
            "latest_s": float(delays.max() - median_s) if len(delays) else 0.0,
        },
        "delay_s": median_s,
        "delay_within_40_ms": float(np.mean(np.abs(delays - median_s) < STEP_S)),
        "events": [(e.name, *(round(s, 1) for s in e.span)) for e in course.events],
        "stopped_with": course.stopped_with,
        "playout": {k: v for k, v in course.figures.items() if v},
    }


def superframes(found: Account) -> dict[str, Any]:
    """Return the shares received: of those without lost datagrams, and without events besides."""
    by_loss = found.lost.get("lost datagram", 0)
    lost = sum(found.lost.values()) - by_loss
    unnamed = sum(n for k, n in found.lost.items() if k in ("unexplained", "unmarked: busy"))
    return {
        "received": found.received,
        "misnumbered": found.misnumbered,
        "lost": found.lost,
        "share_without_lost_datagrams": found.received / max(1, found.received + lost),
        "share_without_events": found.received / max(1, found.received + unnamed),
        "unexplained_s": found.unexplained_s,
    }


def main() -> None:
    """Run, and print what became of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--loss", type=float, default=0.01, help="share of datagrams lost")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--events", nargs="*", choices=tuple(EVENTS), default=list(EVENTS))
    parser.add_argument("--keep", type=Path, help="folder for what came in and went out")
    parser.add_argument("more", nargs="*", help="options of playout, after --")
    options = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folder = options.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        try:
            course, datagrams = run(folder, options)
        except OSError:
            note((folder / "log.txt").read_text()[-6000:])
            raise
        note((folder / "log.txt").read_text()[-6000:])
        if options.keep:
            with (folder / "course.pickle").open("wb") as file:
                pickle.dump((course, datagrams), file)
    figures = report(course, datagrams)
    print(json.dumps(figures, indent=1))
    found = figures["superframes"]
    print(
        f"{found['received']} superframes received, "
        f"{100 * found['share_without_lost_datagrams']:.2f} % of those that {course.lost} lost "
        f"datagrams leave, {100 * found['share_without_events']:.2f} % without the events; "
        f"unmarked {sum(figures['unmarked_s'].values()):.1f} s of {figures['programme_s']:.0f} s; "
        f"delay {figures['delay_s']:.3f} s, {100 * figures['delay_within_40_ms']:.2f} % of the "
        f"packets within 40 ms."
    )


if __name__ == "__main__":
    main()
