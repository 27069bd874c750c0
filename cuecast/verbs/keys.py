"""Show the cues of a text: the phones, the hand shape and placement of every key, and when."""

import argparse

from cuecast.arguments import add_json, add_reading, add_text, print_json, score_of

SUMMARY = "the cues of a text: phones, keys, times"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    add_reading(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the keys of the text; 1 if nothing in it is spoken."""
    keys = score_of(args).keys
    if args.json:
        print_json([key.as_dict() for key in keys])
    else:
        from synth.notation import as_taught

        print("  start     end  key  taught  shape  placement  phones")
        for key in keys:
            print(
                f"{key.start:7.3f} {key.end:7.3f}   {key}     {as_taught(key)}      {key.shape}  "
                f"{key.placement:<9}  "
                f"{' '.join(key.phones)}"
            )
    return 0 if keys else 1
