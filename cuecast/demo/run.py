"""The demonstration from end to end: make, dub, broadcast, receive, compare, draw."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codec.analysis.compare import Comparison, compare_motions
from codec.cuer.motion import Motion, save_motion
from codec.cuer.voice import load_voice
from cuecast.command.files import write_json
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.demo.figures import draw_keys, draw_strip
from cuecast.dubbing.dub import dub
from cuecast.dubbing.motions import SynthesisedMotion, whole_motion
from cuecast.dubbing.readability import in_words, watched_plan
from cuecast.dubbing.receive import receive
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from synth.language.subtitles import Subtitle
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.prosody.pacing import READABLE
from synth.planning.prosody.simulation import PerformerChoice
from synth.planning.scoring.text_score import Reading, score_of_subtitles

BROADCASTS = (
    ("AAC 128 kbit/s in MP4", "broadcast-aac.mp4", "aac", 128_000),
    ("MP2 192 kbit/s in MPEG-TS", "broadcast-mp2.ts", "mp2", 192_000),
)
"""Broadcasts of the dubbed programme: name, file, codec, bit rate."""


@dataclass(frozen=True, slots=True)
class BroadcastOutcome:
    """Reception of one broadcast: its name, what arrived, and how well it agrees."""

    broadcast: str
    summary: dict[str, Any]
    comparison: Comparison | None

    @property
    def correct(self) -> bool:
        """Whether every key arrived that was sent after tune-in."""
        return (
            self.comparison is not None
            and self.comparison.keys_total > 0
            and self.comparison.keys_correct == self.comparison.keys_total
        )


def run_demo(folder: Path, *, seed: int, say: Callable[[str], None]) -> list[BroadcastOutcome]:
    """Run the demonstration and leave its files in `folder`.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    seed : int
        Of the cuer's small motions.
    say : callable
        Called with progress, line by line.

    Raises
    ------
    CueError
        If anything on the way refuses to work.
    """
    folder.mkdir(parents=True, exist_ok=True)
    voice = load_voice()
    say("1/5 making a programme: speech, music, picture")
    sound, subtitles = make_sound()
    duration_s = len(sound) / FS
    (folder / "programme.srt").write_text(as_srt(subtitles), encoding="utf-8")
    write_film(
        folder / "programme.mkv",
        sound,
        FS,
        encoder="flac",
        pictures=make_pictures(duration_s),
        picture_rate=PICTURE_RATE,
    )
    pace = PaceReport(warn=say)
    reading = Reading(pace=READABLE, performing=PerformerChoice(seed=seed))
    score = score_of_subtitles(subtitles, reading=reading, on_word=pace)
    source = SynthesisedMotion(score, voice, seed=seed)

    say(f"    {pace}")
    say(f"    {in_words(watched_plan(source.score).figures())}")
    say(f"2/5 dubbing {duration_s:.0f} s with {len(score.keys)} keys")
    sent = whole_motion(source, duration_s)
    save_motion(sent, folder / "sent.npz")
    dubbed = folder / "dubbed.mkv"
    report = dub(folder / "programme.mkv", source, voice, dubbed)
    write_json(str(folder / "report.json"), report)
    audio = report["carriers"]["audio"]
    say(f"    {audio['net_bps']} bit/s in the sound, SNR {audio['snr_db']} dB, ODG {audio['odg']}")

    outcomes = []
    received: Motion | None = None
    for name, file, codec, bit_rate in BROADCASTS:
        say(f"3/5 broadcasting as {name}")
        rewrite_sound(dubbed, folder / file, lambda *_: Unchanged(), codec=codec, bit_rate=bit_rate)
        # The cuer is in the sound: looking at the pictures compiles as much as all listening.
        reception = receive(folder / file, voice, look=False)
        comparison = None
        if reception.motion is not None:
            received = reception.motion
            save_motion(received, folder / Path(file).with_suffix(".npz").name)
            comparison = compare_motions(sent, received, voice)
        outcomes.append(BroadcastOutcome(name, reception.summary, comparison))
        say(f"4/5 received: {describe(outcomes[-1])}")
    if received is not None:
        say("5/5 drawing")
        film = folder / BROADCASTS[0][1]
        draw_strip(folder / "strip.png", film, subtitles, received, voice)
        draw_keys(folder / "keys.png", sent, received)
    return outcomes


def describe(outcome: BroadcastOutcome) -> str:
    """Return one line about an outcome."""
    frames, c = outcome.summary["superframes"], outcome.comparison
    if c is None:
        return "nothing"
    return (
        f"{frames['received']} superframes, {frames['lost']} lost, tuned in after "
        f"{outcome.summary['tune_in_s']:.2f} s, {c.keys_correct} of {c.keys_total} keys, "
        f"markers {c.marker_rms_mm:.2f} mm"
    )


def as_srt(subtitles: list[Subtitle]) -> str:
    """Return subtitles as the text of an SRT file.

    Examples
    --------
    >>> print(as_srt([Subtitle(1.0, 2.5, "Bonsoir")]), end="")
    1
    00:00:01,000 --> 00:00:02,500
    Bonsoir
    """
    return "\n".join(
        f"{number}\n{_clock(s.start_s)} --> {_clock(s.end_s)}\n{s.text}\n"
        for number, s in enumerate(subtitles, 1)
    )


def _clock(time_s: float) -> str:
    seconds, milliseconds = divmod(round(time_s * 1000), 1000)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d},{milliseconds:03d}"
