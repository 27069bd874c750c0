"""Show the cues of a text: the phones, the hand shape and placement of every key, and when."""

import argparse

from cuecast.arguments import (
    add_alignment,
    add_json,
    add_reading,
    add_text,
    print_json,
    reading_of,
    score_of,
)

SUMMARY = "the cues of a text: phones, keys, times"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    add_alignment(parser)
    add_reading(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the keys of the text; 1 if nothing in it is spoken."""
    from synth.movement import target_times

    score = score_of(args)
    options = reading_of(args)["options"]
    targets = target_times(score, alignment=args.alignment, options=options)
    if args.json:
        keys = zip(score.keys, targets, strict=True)
        print_json([key.as_dict() | {"target": round(at, 4)} for key, at in keys])
    else:
        from synth.notation import as_taught

        print("  start     end  target  key  taught  shape  placement  phones")
        for key, at in zip(score.keys, targets, strict=True):
            print(
                f"{key.start:7.3f} {key.end:7.3f} {at:7.3f}   {key}     {as_taught(key)}      "
                f"{key.shape}  {key.placement:<9}  "
                f"{' '.join(key.phones)}"
            )
    return 0 if score.keys else 1
