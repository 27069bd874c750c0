"""A programme over UDP with all that goes wrong in an hour, and what became of its superframes.

In: nothing; a stream of announcements and music is made, with two changes of format. Out: delay,
other streams, and superframes received, where each lost one is put down to a lost datagram, to an
event (a process killed or stopped, a change of format) or to nothing. The bench stands for the
service manager that starts the playout again. Linux only. Run:
``python tests/bench/hour_on_air.py --minutes 60``.
"""

import argparse
import itertools
import json
import os
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
from cuecast.live.own_reception import OwnReceiver
from cuecast.live.packets import PesReader, clock_of, pid_of, read_stamp
from cuecast.media.tables import NULL_PID, PACKET, payload_of

SOUND_PID = 257
FORMS = (("aac", "stereo", 160_000), ("mp2", "stereo", 192_000), ("aac", "mono", 96_000))
EVENTS = {
    "killed": (0.2, "worker killed"), "stopped": (0.5, "worker stopped for 5 s"),
    "main": (0.8, "main killed"),
}  # fmt: skip
"""At which part of the programme each event happens."""

AROUND_S = 3.0
"""Before and after an event, superframes that are lost are put down to it."""

PORT = 9000 + os.getpid() % 1000


@dataclass
class Course:
    """What was sent, lost and received, with times of `time.monotonic`."""

    sent: list[tuple[float, bytes]] = field(default_factory=list)
    lost: list[bytes] = field(default_factory=list)
    came: list[tuple[float, bytes]] = field(default_factory=list)
    events: list[tuple[str, float]] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)


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
                frame = av.VideoFrame.from_ndarray(
                    np.full((64, 64, 3), n % 256, np.uint8), format="rgb24"
                )
                frame.pts, frame.time_base = n, Fraction(1, 25)
                out.mux(picture.encode(frame))
                at = n * FS // 25 % (length * FS)
                part = sound[at : at + FS // 25]
                part = part if layout == "stereo" else part.mean(axis=1, keepdims=True)
                block = av.AudioFrame.from_ndarray(
                    np.ascontiguousarray(part.T), "fltp", layout
                ) if codec == "aac" else av.AudioFrame.from_ndarray(
                    (part * 32767).astype(np.int16).reshape(1, -1), "s16", layout
                )  # fmt: skip
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
    return [
        (float(due[n]), b"".join(packets[n : n + 7])) for n in range(0, len(packets), 7)
    ]  # fmt: skip


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Service:
    """The playout as a service manager runs it."""

    def __init__(self, source: int, target: int, folder: Path, more: list[str]) -> None:
        self._command = [
            sys.executable, "-m", "cuecast", "playout", f"udp://127.0.0.1:{source}",
            f"udp://127.0.0.1:{target}", "--subtitles", str(folder / "a.srt"), "--port", str(PORT),
            *more,
        ]  # fmt: skip
        self._log = (folder / "log.txt").open("a")
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(self._command, stderr=self._log)

    def workers(self) -> list[int]:
        """Processes of the playout, the marking one first."""
        task = Path(f"/proc/{self.process.pid}/task")
        found = [int(c) for t in task.iterdir() for c in (t / "children").read_text().split()]
        spawned = [c for c in found if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]
        return sorted(spawned)

    def health(self) -> dict[str, Any]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/health", timeout=5) as answer:
                return dict(json.loads(answer.read()))
        except urllib.error.HTTPError as error:
            return dict(json.loads(error.read()))
        except OSError:
            return {"state": "none"}

    def figures(self) -> dict[str, float]:
        while self.health()["state"] == "none" and self.process.poll() is None:
            time.sleep(0.5)
        with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/metrics", timeout=5) as answer:
            text = answer.read().decode()
        found = re.findall(r"^cuecast_(\w+) (\S+)$", text, re.M)
        return {name: float(value) for name, value in found}

    def wait(self) -> None:
        while self.health()["state"] not in ("ready", "marked"):
            if self.process.poll() is not None:
                raise OSError("the playout ended")
            time.sleep(0.5)


def add(figures: dict[str, float], more: dict[str, float]) -> None:
    for name, value in more.items():
        figures[name] = figures.get(name, 0.0) + value if name.endswith("_total") else value


def run(folder: Path, options: argparse.Namespace) -> tuple[Course, list[tuple[float, bytes]]]:
    """Play the programme through the playout while things go wrong."""
    seconds = int(60 * options.minutes)
    datagrams = paced(write_stream(folder, seconds))
    source, target = free_port(), free_port()
    course, rng, over = Course(), random.Random(options.seed), threading.Event()
    back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    back.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 24)
    back.bind(("127.0.0.1", target))
    back.settimeout(0.5)

    def receive() -> None:
        while not over.is_set():
            try:
                course.came.append((time.monotonic(), back.recv(65536)))
            except TimeoutError:
                continue

    threading.Thread(target=receive, daemon=True).start()
    service = Service(source, target, folder, options.more)
    service.wait()
    while options.events and not service.figures()["stands_by"]:
        time.sleep(0.5)
    plan = [EVENTS[name] for name in EVENTS if name in options.events]
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    begin = time.monotonic()
    for due, data in datagrams:
        wait_s = begin + due - time.monotonic()
        if wait_s > 0:
            time.sleep(wait_s)
        if plan and due >= plan[0][0] * seconds:
            _, name = plan.pop(0)
            course.events.append((name, due))
            if name == "worker killed":
                os.kill(service.workers()[0], signal.SIGKILL)
            elif name.startswith("worker stopped"):
                stopped = service.workers()[0]
                os.kill(stopped, signal.SIGSTOP)
                threading.Timer(5.0, resume, [stopped]).start()
            else:
                add(course.figures, service.figures())
                service.process.kill()
                service.process.wait()
                threading.Timer(1.0, service.start).start()
        if rng.random() < options.loss:
            course.lost.append(data)
            continue
        course.sent.append((time.monotonic(), data))
        line.sendto(data, ("127.0.0.1", source))
    time.sleep(1.0)
    add(course.figures, service.figures())
    print(f"health {service.health()}")
    service.process.terminate()
    print(f"stopped with {service.process.wait(60)}")
    time.sleep(1.0)
    over.set()
    return course, datagrams


def resume(process: int) -> None:
    try:
        os.kill(process, signal.SIGCONT)
    except ProcessLookupError:  # another one took its place
        return


def packets_of(pieces: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
    return [(t, d[at : at + PACKET]) for t, d in pieces for at in range(0, len(d), PACKET)]


def others(pieces: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
    return [(t, p) for t, p in packets_of(pieces) if pid_of(p) not in (SOUND_PID, NULL_PID)]


def follow(one: list[tuple[float, bytes]], other: list[tuple[float, bytes]]) -> tuple[Any, int]:
    """Return the delays of packets that came, in order, and how many did not come."""
    delays, at, missing = [], 0, 0
    for sent_s, packet in one:
        ahead = range(at, min(at + 400, len(other)))
        found = next((n for n in ahead if other[n][1] == packet), None)
        if found is None:
            missing += 1
        else:
            delays.append(other[found][0] - sent_s)
            at = found + 1
    return np.array(delays), missing


def received(came: list[tuple[float, bytes]], datagrams: list[tuple[float, bytes]]) -> list[float]:
    """Return the times of the programme at which received superframes begin."""
    starts = []
    first = first_stamp([d for _, d in datagrams])
    receiver, reader = OwnReceiver(0), PesReader()
    total = max(d for d, _ in datagrams)
    for _, packet in packets_of(came):
        if pid_of(packet) == SOUND_PID:
            for pes in reader.process(packet):
                at_s = ((pes.pts or 0) - first) / 90_000
                kind = FORMS[min(int(at_s / total * len(FORMS)), len(FORMS) - 1)][0]
                starts += [(s - first) / 90_000 for s in receiver.process(kind, pes)]
    return sorted(starts)


def first_stamp(datagrams: list[bytes]) -> int:
    for data in datagrams:
        for at in range(0, len(data), PACKET):
            packet = data[at : at + PACKET]
            if pid_of(packet) == SOUND_PID and packet[1] & 0x40:
                return read_stamp(payload_of(packet)[9:14])
    raise ValueError("no sound")


def main() -> None:
    """Run, and print what became of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--loss", type=float, default=0.01, help="share of datagrams lost")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--events", nargs="*", choices=tuple(EVENTS), default=list(EVENTS))
    parser.add_argument("more", nargs="*", help="options of playout, after --")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            course, datagrams = run(folder, options)
        except OSError:
            print((folder / "log.txt").read_text()[-6000:])
            raise
        log = (folder / "log.txt").read_text()
    total = 60 * options.minutes
    delays, missing = follow(others(course.sent), others(course.came))
    print(f"other streams: {len(delays)} packets as sent, {missing} missing")
    late = np.abs(delays - np.median(delays)) if len(delays) else np.zeros(1)
    print(
        f"delay: median {np.median(delays):.3f} s, {100 * np.mean(late < 0.04):.2f} % within 40 ms"
    )
    dropped = {id(d) for d in course.lost}
    hit = [due for due, d in datagrams if id(d) in dropped]
    events = [*course.events, *(("format", total * n / len(FORMS)) for n in (1, 2))]
    wanted = ("marked_s", "bypass", "takeovers", "restarts", "eased", "joint", "read_back", "stale",
              "packets_lost", "damaged")  # fmt: skip
    print({k: round(v, 3) for k, v in course.figures.items() if k.startswith(wanted)})
    print("\n".join(line for line in log.splitlines() if "caption" not in line)[-6000:], flush=True)
    starts = np.array(received(course.came, datagrams))
    if not len(starts):
        raise SystemExit("no superframe was received")
    causes = {"lost datagram": 0, "unexplained": 0} | {n: 0 for n, _ in events}
    for one, other in itertools.pairwise(starts):
        for n in range(1, round((other - one) / 0.64)):
            at = one + 0.64 * n
            near = [e for e, t in events if -AROUND_S < at - t < AROUND_S + 12 * ("main" in e)]
            cause = near[0] if near else "unexplained"
            if not near and any(at - 0.3 < t < at + 1.0 for t in hit):
                cause = "lost datagram"
            causes[cause] += 1
            if cause == "unexplained":
                print(f"unexplained: superframe at {at:.2f} s")
    print(f"superframes: {len(starts)} received, first at {starts[0]:.2f} s, not: {causes}")
    left = len(starts) + causes["unexplained"]
    print(f"of those that losses and events leave: {100 * len(starts) / left:.2f} %")


if __name__ == "__main__":
    main()
