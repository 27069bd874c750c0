"""Make and look at voices: the models and dictionaries of one cuer."""

import argparse
from typing import Any

from cuecast.command.arguments import add_json, positive, print_json
from cuecast.command.progress import count_bar, note

SUMMARY = "make and look at voices"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="names of the built-in voices")
    info = actions.add_parser("info", help="what a voice is made of")
    info.add_argument("voice", nargs="?", default="claire", metavar="V", help="name or file")
    build = actions.add_parser(
        "build",
        help="record the units of a voice, the virtual cuer's own or a real speaker's, and train "
        "its coding tables",
    )
    build.add_argument("voice", nargs="?", default="claire", metavar="V", help="name or file")
    build.add_argument(
        "--recordings",
        metavar="DIR",
        help="sounds of a speaker with transcripts: a .tsv with path and text, or .txt beside each",
    )
    build.add_argument(
        "--kbit",
        type=positive,
        metavar="N",
        help="with --recordings: keep the sounds in Opus of N kbit/s, 6 to 256, not exactly",
    )
    build.add_argument(
        "--without",
        metavar="NAMES",
        help="with --recordings: names of sounds that are kept for judging, between commas",
    )
    build.add_argument(
        "--corpora",
        metavar="DIR",
        help="takes of a new speaker's hand, face and both: C3D files, a TextGrid beside each",
    )
    build.add_argument(
        "--map", metavar="FILE", help="with --corpora: labels and our markers, as for capture"
    )
    build.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        help="where a speaker's units go; with --corpora a new folder, named as the voice",
    )
    export = actions.add_parser(
        "export", help="one file of voice and tables for the receiver of devices and pages"
    )
    export.add_argument("voice", nargs="?", default="claire", metavar="V", help="name or file")
    export.add_argument("-o", "--output", required=True, metavar="F.bin", help="file to write")
    for action in (listing, info, build, export):
        add_json(action)


def run(args: argparse.Namespace) -> int:
    """Carry out the action."""
    actions = {"list": _list, "info": _info, "build": _build, "export": _export}
    return actions[args.action](args)


def _list(args: argparse.Namespace) -> int:
    from codec.cuer.voice import built_in_voices

    names = built_in_voices()
    if args.json:
        print_json(list(names))
    else:
        print("\n".join(names))
    return 0


def _info(args: argparse.Namespace) -> int:
    from codec.cuer.voice import load_voice
    from codec.superframe.coding import coding_for, trained_path

    voice = load_voice(args.voice)
    facts = {
        "name": voice.name,
        "identity": voice.identity,
        "parameters": len(voice.layout),
        "layout": list(voice.layout),
        "coding": coding_for(voice).identity,
        "tables": str(trained_path(voice) or "derived"),
    }
    _show(args, facts)
    return 0


def _export(args: argparse.Namespace) -> int:
    import zlib

    from codec.cuer.voice import load_voice
    from codec.files.whole import whole_file
    from receiver.export.device_voice import DIGEST_BYTES, device_voice

    voice = load_voice(args.voice)
    data = device_voice(voice)
    with whole_file(args.output) as path:
        path.write_bytes(data)
    facts = {
        "name": voice.name,
        "identity": voice.identity,
        "bytes": len(data),
        "compressed": len(zlib.compress(data, 9)),
        "sha256": data[-DIGEST_BYTES:].hex(),
    }
    _show(args, facts)
    return 0


def _build(args: argparse.Namespace) -> int:
    from codec.cuer.voice import load_voice
    from codec.superframe.coding import coding_for
    from cuecast.command.voices import train_voice
    from cuecast.dubbing.performance import record_folder, unit_synthesiser

    if args.corpora and args.recordings:
        note("cuecast voice build: either --corpora or --recordings")
        return 2
    if bool(args.recordings or args.corpora) != bool(args.output):
        note("cuecast voice build: --recordings or --corpora goes with --output")
        return 2
    if args.map and not args.corpora:
        note("cuecast voice build: --map goes with --corpora")
        return 2
    if args.corpora:
        return _build_from_corpora(args)
    voice = load_voice(args.voice)
    refused: list[str] = []
    if args.recordings:
        with count_bar("recording the voice") as progress:
            refused = record_folder(
                args.recordings,
                args.output,
                voice,
                kbit_s=args.kbit,
                progress=progress,
                without=frozenset((args.without or "").split(",")),
            )
        for line in refused:
            note(f"left out: {line}")
    synthesiser = unit_synthesiser(voice, args.output)
    if not args.recordings:  # another speaker leaves the cuer and her tables as they are
        with count_bar("training the codec") as progress:
            train_voice(voice, progress=progress)
    facts: dict[str, Any] = {
        "voice": voice.name,
        "coding": coding_for(voice).identity,
        "recordings": len(synthesiser.recordings),
        "refused": len(refused),
        "minutes": round(sum(r.duration_s for r in synthesiser.recordings) / 60, 1),
        "sounds": len(synthesiser.sounds),
        "kinds_of_sounds": len(synthesiser.sounds.names),
        "dikeys": len(synthesiser.dikeys),
        "kinds_of_dikeys": len(synthesiser.dikeys.names),
    }
    _show(args, facts)
    return 0


def _build_from_corpora(args: argparse.Namespace) -> int:
    from cuecast.dubbing.new_voice import build_from_corpora
    from synth.capture.points.labels import read_map

    mapping = read_map(args.map) if args.map else None
    with count_bar("learning the speaker") as progress:
        facts = build_from_corpora(args.corpora, args.output, mapping=mapping, progress=progress)
    for take in facts["left_out"]:
        note(f"left out: {take}: the hand does not show the keys of its TextGrid")
    borrowed = facts["borrowed_sounds"]
    if borrowed:
        pairs = ", ".join(f"{sound} as {other}" for sound, other in borrowed.items())
        note(f"sounds that no take holds look like others: {pairs}")
    _show(args, facts)
    return 0


def _show(args: argparse.Namespace, facts: dict[str, Any]) -> None:
    if args.json:
        print_json(facts)
        return
    width = max(map(len, facts))
    for name, value in facts.items():
        if isinstance(value, dict):
            value = [f"{key} {one}" for key, one in value.items()]
        shown = ", ".join(value) if isinstance(value, list) else value
        print(f"{name.replace('_', ' '):>{width}}  {shown}")
