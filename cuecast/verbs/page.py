"""Write a folder for any static web server: a programme, and the player that shows its cuer."""

import argparse

from cuecast.command.arguments import add_avatar, add_json, add_voice, print_json

SUMMARY = "a folder with programme and player, for any web server"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "programme", metavar="PROGRAMME", help="a marked programme that browsers play: mp4, webm"
    )
    parser.add_argument(
        "-o", "--output", required=True, metavar="DIR", help="the folder, new or empty"
    )
    parser.add_argument(
        "--verify", metavar="PUBLIC", help="the page says whether the cues are of this key"
    )
    add_json(parser)
    add_avatar(parser)
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the folder; print how to serve it."""
    from cuecast.command.voices import coding_voice
    from cuecast.media.avatars import avatar_file
    from cuecast.media.captions import captions_of
    from receiver.web.folder import write_folder

    voice, captions = coding_voice(args.voice), captions_of(args.programme)
    text = (captions.data, captions.language) if captions else ()
    avatar = avatar_file(args.avatar, voice)
    files = write_folder(
        args.programme, args.output, voice, *text, avatar=avatar, public=args.verify
    )
    if args.json:
        print_json({"folder": args.output, "files": files})
    else:
        print(f"{len(files)} files in {args.output}: python3 -m http.server -d {args.output}")
    return 0
