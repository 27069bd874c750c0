"""Find the cuer in a programme, as a television would."""

import argparse
import sys
from typing import Any

from codec.errors import CueError
from cuecast.command.arguments import (
    add_json,
    add_key,
    add_voice,
    natural,
    not_negative,
    print_json,
)
from cuecast.command.files import PIPE
from cuecast.command.progress import note, seconds_bar
from cuecast.command.trust import add_on_air, add_trust, trust_of

SUMMARY = "everything that a receiver finds"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("programme", metavar="PROGRAMME", help="sound or video file; - is a pipe")
    parser.add_argument("-o", "--output", metavar="M.npz", help="the motion received")
    parser.add_argument("--markers", metavar="M.c3d", help="its markers: C3D, TRC, CSV, or GLB")
    parser.add_argument(
        "--start", type=not_negative, default=0.0, metavar="S", help="switch on at second S"
    )
    senses = parser.add_mutually_exclusive_group()
    senses.add_argument("--sound-only", action="store_true", help="do not search the picture")
    senses.add_argument("--picture-only", action="store_true", help="do not search the sound")
    parser.add_argument("--track", type=natural, default=0, metavar="N", help="which sound, from 0")
    add_json(parser)
    add_trust(parser)
    add_on_air(parser, "when the recording began on air")
    add_voice(parser)
    add_key(parser)


def run(args: argparse.Namespace) -> int:
    """Print the findings; 1 if there are none."""
    from codec.cuer.motion import save_motion
    from cuecast.command.voices import coding_voice
    from cuecast.dubbing.receive import receive

    source = sys.stdin.buffer if args.programme == PIPE else args.programme
    wanted = args.output is not None or args.markers is not None
    voice = coding_voice(args.voice)
    with seconds_bar(None, "receive") as advance:
        reception = receive(
            source, voice, start_s=args.start, key=args.key, track=args.track,
            keep_motion=wanted, listen=not args.picture_only, look=not args.sound_only,
            trust=trust_of(args), progress=advance,
        )  # fmt: skip
    if reception.damaged:
        note(f"note: {args.programme}: {reception.damaged} damaged packets")
    if reception.foreign:
        note(f"note: {args.programme}: a part of it is not for this receiver: {reception.foreign}")
    summary = reception.summary
    if reception.other_sounds and not summary["superframes"]["received"]:
        note(
            f"note: {args.programme}: nothing in its sound {args.track}; it has "
            f"{reception.other_sounds} more: try --track"
        )
    whose = summary["authenticity"]
    if whose is not None and whose["verified_s"] is not None and args.on_air is None:
        note(
            f"note: verified as the broadcast of {whose['on_air']}: the keys of a recording are "
            "public, so this holds if it was recorded then"
        )
    if args.trust is not None and whose is not None and whose["superframes"]["unknown"]:
        note(
            f"note: {whose['superframes']['unknown']} superframes are not shown: nothing proves "
            "them; what proves the last 20 s comes after them; the key file holds "
            f"{whose['holds']}"
        )
    if whose is not None and whose["downgraded_s"] is not None:
        note(
            f"warning: from {whose['downgraded_s']:.1f} s on the cues are not signed, though "
            f"{whose['of']} signs: somebody may have replaced them"
        )
    if args.output is not None and reception.motion is not None:
        save_motion(reception.motion, args.output)
    if reception.motion is None and wanted:
        files = " and ".join(path for path in (args.output, args.markers) if path)
        note(f"note: {files} not written: there is no motion to write")
    if args.markers is not None and reception.motion is not None:
        from receiver.export.files import export_motion

        export_motion(reception.motion, voice, args.markers)
    if args.json:
        print_json(summary)
    else:
        _print(summary)
    if reception.fault:  # a file that breaks off is malformed; its content has been reported
        raise CueError(reception.fault)
    return 0 if summary["superframes"]["received"] else 1


def _print(summary: dict[str, Any]) -> None:
    """Print the summary as sentences, then the keys one a line."""
    for line in in_words(summary):
        print(line)
    for key in summary["keys"]:
        print(
            f"{key['start']:9.2f} {key['end']:8.2f}  {key['shape']} {key['placement']:<7} "
            f"{' '.join(key['phones'])}"
        )


def in_words(summary: dict[str, Any]) -> list[str]:
    """Return a receiver's findings, one fact a line.

    Examples
    --------
    >>> none = {"received": 0, "lost": 0}
    >>> in_words({
    ...     "duration_s": 27.0, "superframes": none, "carriers": {"audio": {"locked": False}}
    ... })
    ['no cuer found in 27.0 s (searched: audio)']
    """
    frames, carriers = summary["superframes"], summary["carriers"]
    if not frames["received"]:
        searched = ", ".join(carriers) or "nothing that can carry one"
        return [f"no cuer found in {summary['duration_s']:.1f} s (searched: {searched})"]
    lines = [
        f"{len(summary['keys'])} keys in {summary['duration_s']:.1f} s; first found after "
        f"{summary['tune_in_s']:.2f} s",
        f"{frames['received']} superframes received, {frames['lost']} lost"
        + "".join(f"; {n} of part {part}" for part, n in layers_of(summary).items()),
    ]
    for name, figures in carriers.items():
        if figures["locked"]:
            ratio = figures["ber_estimate"]
            lines.append(
                f"{name}: locked" + ("" if ratio is None else f", bit error ratio {ratio:.4f}")
            )
        else:
            lines.append(f"{name}: nothing found")
    if summary["recovered_together"]:
        lines.append(f"{summary['recovered_together']} superframes only by adding carriers")
    lines.append(f"voice {summary['voice']}; {summary['realtime_factor']:.1f} times real time")
    if summary["authenticity"] is not None:
        proof = summary["authenticity"]
        count = ", ".join(f"{n} {name}" for name, n in proof["superframes"].items())
        lines.append(f"authenticity: {proof['status']} ({count} superframes)")
    return lines


def layers_of(summary: dict[str, Any]) -> dict[str, int]:
    """Return how many of each part of the superframes arrived."""
    return {part: figures["received"] for part, figures in summary["layers"].items()}
