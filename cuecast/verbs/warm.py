"""Compile everything that is compiled on first use, once, so that no work waits for it.

The compiled kernels lie beside the program, or in the folder NUMBA_CACHE_DIR, which the workers of
a batch and the processes of a playout may share.
"""

import argparse
import time

from cuecast.command.progress import note

SUMMARY = "compile the kernels, once for all processes"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--carriers", choices=("audio", "all"), default="audio", help="audio by default"
    )


def run(args: argparse.Namespace) -> int:
    """Dub a short programme and receive it."""
    from cuecast.demo.warming import warm_kernels

    began_s = time.monotonic()
    place = warm_kernels("audio" if args.carriers == "audio" else "audio,video,a335")
    note(f"warm after {time.monotonic() - began_s:.1f} s, kernels {place}")
    return 0
