"""Look at voices: the models and dictionaries of one cuer."""

import argparse

from cuecast.arguments import add_json, print_json

SUMMARY = "look at voices"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="names of the built-in voices")
    info = actions.add_parser("info", help="what a voice is made of")
    info.add_argument("voice", nargs="?", default="claire", metavar="V", help="name or file")
    for action in (listing, info):
        add_json(action)


def run(args: argparse.Namespace) -> int:
    """Print names, or the facts about one voice."""
    from codec.voice import built_in_voices, load_voice

    if args.action == "list":
        names = built_in_voices()
        if args.json:
            print_json(list(names))
        else:
            print("\n".join(names))
        return 0
    voice = load_voice(args.voice)
    facts = {
        "name": voice.name,
        "identity": voice.identity,
        "parameters": len(voice.layout),
        "layout": list(voice.layout),
    }
    if args.json:
        print_json(facts)
    else:
        for name, value in facts.items():
            print(f"{name:>10}  {' '.join(value) if isinstance(value, list) else value}")
    return 0
