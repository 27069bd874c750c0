"""Show the cues of a text: the phones, the hand shape and placement of every key, and when."""

import argparse
from typing import TYPE_CHECKING

from codec.files.whole import whole_file
from cuecast.command.arguments import (
    add_json,
    add_pace,
    add_reading,
    add_subtitle_terms,
    add_text,
    print_json,
)
from cuecast.command.progress import note
from cuecast.dubbing.inputs import pieces_of, reading_of, score_of

if TYPE_CHECKING:
    from codec.cues.score import Score
    from synth.planning.prosody.pace_report import PaceReport

SUMMARY = "the cues of a text: phones, keys, times"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    parser.add_argument(
        "--alignment",
        choices=("attina", "paper"),
        help="say when the hand is on target, by the rule that synth follows: early in the "
        "consonant (Attina 2005) or in its middle (Gibert, Bailly, Elisei 2004)",
    )
    parser.add_argument(
        "--align", metavar="AUDIO", help="recording of the text: times are those of its voice"
    )
    parser.add_argument(
        "--textgrid", metavar="T.TextGrid", help="phones and keys as two tiers for Praat"
    )
    parser.add_argument(
        "--unknown",
        action="store_true",
        help="only the words that no lexicon knows, with the phones taken: mend them, and give the "
        "lines to --lexicon",
    )
    add_reading(parser)
    add_pace(parser)
    add_subtitle_terms(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the keys of the text; 1 if nothing in it is spoken."""
    if args.unknown:
        return _unknown(args)
    from synth.planning.prosody.pace_report import PaceReport

    pace = PaceReport(reading_of(args).options, note)
    score = _score(args, pace)
    targets = _targets(args, score)
    if args.textgrid and score.phones:
        from synth.planning.scoring.textgrid import write_textgrid

        with whole_file(args.textgrid) as path:
            write_textgrid(path, score, score.phones[-1].end)
    if args.json:
        rows = [key.as_dict() for key in score.keys]
        print_json([row | target for row, target in zip(rows, targets, strict=True)])
    else:
        from synth.planning.scoring.notation import as_taught

        named = "  target" if args.alignment else ""
        print(f"  start     end{named}  key  taught  shape  placement  phones")
        for key, target in zip(score.keys, targets, strict=True):
            times = [key.start, key.end, *target.values()]
            print(
                f"{' '.join(f'{t:7.3f}' for t in times)}   {key}     {as_taught(key)}      "
                f"{key.shape}  {key.placement:<9}  {' '.join(key.phones)}"
            )
    if score.keys:
        _tell(args, score, pace)
    return 0 if score.keys else 1


def _tell(args: argparse.Namespace, score: "Score", pace: "PaceReport") -> None:
    """Say how well the keys can be read."""
    from cuecast.dubbing.readability import in_words, watched_plan

    seen = watched_plan(score, options=reading_of(args).options)
    pace.seen(seen.shown)
    note(str(pace))
    note(in_words(seen.figures()))


def _unknown(args: argparse.Namespace) -> int:
    """Print the words that no lexicon knows as lines of a lexicon."""
    from cuecast.dubbing.inputs import subtitles_of, terms_of, unknown_report
    from synth.language.subtitles import Subtitle

    subtitles = [Subtitle(0, 1, args.text)] if args.text is not None else None
    rows = unknown_report(subtitles or subtitles_of(args.file, terms_of(args)), reading_of(args))
    if args.json:
        print_json(rows)
    else:
        for row in rows:
            print(f"{row['word']}\t{row['phones']}\t# line {row['line']}, {row['count']} times")
    return 0


def _score(args: argparse.Namespace, pace: "PaceReport") -> "Score":
    if args.align is None:
        return score_of(args, pace)
    from codec.cues.score import Score
    from cuecast.dubbing.aligning import Confidence

    confidence = Confidence()
    pieces = list(pieces_of(args, args.align, confidence, pace)[0])
    note(str(confidence))
    return Score(
        tuple(phone for piece in pieces for phone in piece.phones),
        tuple(key for piece in pieces for key in piece.keys),
    )


def _targets(args: argparse.Namespace, score: "Score") -> list[dict[str, float]]:
    """Return when the hand is on the target of each key, if that was asked."""
    if not args.alignment:
        return [{} for _ in score.keys]
    from synth.motion.rules.movement import target_times

    options = reading_of(args).options
    times = target_times(score, alignment=args.alignment, options=options)
    return [{"target": round(at, 4)} for at in times]
