"""Make the motion of a cuer, and the sound of a speaker, from text or subtitles."""

import argparse

from cuecast.arguments import add_seed, add_text, add_voice, positive, score_of
from cuecast.progress import seconds_bar

SUMMARY = "motion (and speech) from text"

_PIECE_S = 0.64
_AFTER_S = 1.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    parser.add_argument("-o", "--output", required=True, metavar="M.npz", help="motion")
    parser.add_argument("--speech", metavar="S.wav", help="what is said, spoken in step")
    parser.add_argument("--c3d", metavar="M.c3d", help="markers of the motion")
    parser.add_argument("--rate", type=positive, default=50.0, metavar="HZ", help="of the motion")
    add_voice(parser)
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Write the motion; 1 if nothing in the text is spoken."""
    score = score_of(args)
    if not score.keys:
        return 1
    from codec.motion import save_motion
    from codec.voice import load_voice
    from cuecast.motions import SynthesisedMotion, whole_motion

    voice = load_voice(args.voice)
    source = SynthesisedMotion(score, voice, seed=args.seed, rate_hz=args.rate)
    end_s = score.phones[-1].end + _AFTER_S
    with seconds_bar(end_s, "synth") as advance:
        motion = whole_motion(source, end_s, progress=advance)
    save_motion(motion, args.output)
    return 0
