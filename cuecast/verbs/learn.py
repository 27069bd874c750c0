"""Serve a page for learners of cued speech: sentences, labial doubles, keys, a sheet to print."""

import argparse

from cuecast.command.arguments import add_voice, natural
from cuecast.command.progress import note

SUMMARY = "a page for learners: sentences, quizzes, a sheet"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--port", type=natural, default=8081, metavar="N", help="0: any free one")
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Serve the page."""
    from codec.cuer.voice import load_voice
    from cuecast.practice.pages import LearnerPages, serve_pages

    pages = LearnerPages(load_voice(args.voice), port=args.port)
    serve_pages(pages, lambda url: note(f"learn at {url}"))
    return 0
