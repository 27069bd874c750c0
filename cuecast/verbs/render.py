"""Draw a motion: a film, or one picture."""

import argparse

from cuecast.command.arguments import add_avatar, add_voice, natural, not_negative, size
from cuecast.command.progress import seconds_bar

SUMMARY = "a film or a picture of the cuer"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("motion", metavar="M.npz")
    parser.add_argument("-o", "--output", required=True, metavar="OUT.mp4", help="MP4 or PNG")
    parser.add_argument("--style", default="points", choices=("points", "avatar"))
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--look", metavar="NAME", help="the avatar's appearance: woman, man, elder")
    add_avatar(shown)
    parser.add_argument("--rate", type=natural, default=25, metavar="FPS", help="of a film")
    parser.add_argument("--at", type=not_negative, metavar="S", help="second that a PNG shows")
    parser.add_argument("--background", metavar="PICTURE", help="picture behind the cuer")
    parser.add_argument(
        "--size", type=size, metavar="WxH", help="pixels; 620x720, or the picture's"
    )
    parser.add_argument("--programme", metavar="P", help="whose sound and subtitles a film gets")
    parser.add_argument("--subtitles", metavar="SUBS", help="captions, in place of the programme's")
    parser.add_argument(
        "--subtitle-track", metavar="N|LANG", help="which of the programme's own, from 0"
    )
    parser.add_argument("--mirror", action="store_true", help="a left-handed cuer")
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the film or the picture."""
    from codec.cuer.motion import load_motion
    from codec.cuer.voice import load_voice
    from cuecast.media.avatars import avatar_file
    from cuecast.media.cuer_film import render_motion

    motion, voice = load_motion(args.motion), load_voice(args.voice)
    own = avatar_file(args.avatar, voice)
    with seconds_bar(motion.duration_s, "render") as advance:
        done = 0

        def progress(frames: int, total: int) -> None:
            nonlocal done
            advance((frames - done) / total * motion.duration_s)
            done = frames

        render_motion(
            motion, voice, args.output, style=args.style if own is None else "avatar",
            fps=args.rate, at_s=args.at,
            background=args.background, size=args.size, mirror=args.mirror,
            programme=args.programme, subtitles=args.subtitles, track=args.subtitle_track,
            look=args.look, avatar=own, progress=progress,
        )  # fmt: skip
    return 0
