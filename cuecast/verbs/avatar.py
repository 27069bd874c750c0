"""Make an avatar of one's own out of a VRM or glTF file, once, for page, player and render.

The file needs a humanoid's bones with all fingers of the right hand, a mouth that opens, and eyes;
ARKit's 52 face shapes make its lips readable, VRM's five do not.
"""

import argparse

from cuecast.command.arguments import add_json, add_voice, print_json
from cuecast.command.progress import note, printable

SUMMARY = "an avatar of one's own, from a VRM or glTF file"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("model", metavar="MODEL.vrm", help="VRM 0 or 1, or glTF (.glb)")
    parser.add_argument("-o", "--output", required=True, metavar="OUT.avatar")
    add_json(parser)
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the avatar; print how well it fits."""
    from codec.files.whole import whole_file
    from cuecast.command.voices import coding_voice
    from receiver.drawing.avatar_document import avatar_document
    from receiver.foreign.build import foreign_avatar

    avatar, fit = foreign_avatar(args.model, coding_voice(args.voice))
    with whole_file(args.output) as temporary:
        temporary.write_bytes(avatar_document(avatar))
    if not fit.readable_lips:
        note("the file has VRM's five mouth shapes only: its lips cannot be read")
    if fit.terms:
        note(f"the file states: {printable(fit.terms)}")
    moves = {name: round(far, 1) for name, far in fit.moves_mm.items()}
    if args.json:
        print_json(
            {
                "output": args.output,
                "readable_lips": fit.readable_lips,
                "lips_mm": round(fit.lips_mm, 2),
                "hand_mm": round(fit.hand_mm, 2),
                "upper_arm_stretch": round(fit.stretch, 3),
                "places_mm": moves,
                "terms": fit.terms,
            }
        )
    else:
        print(f"lips within {fit.lips_mm:.1f} mm, hand within {fit.hand_mm:.1f} mm of the cuer's")
        print("places moved by " + ", ".join(f"{far} mm ({name})" for name, far in moves.items()))
    return 0
