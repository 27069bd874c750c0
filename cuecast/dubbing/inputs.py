"""From a command's input (text, subtitles, a recording to align to) to scores."""

import argparse
from typing import TYPE_CHECKING, Any

from cuecast.command.arguments import REST_S
from cuecast.command.files import PIPE, read_bytes
from cuecast.command.progress import note

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from codec.cues.score import Score
    from synth.language.subtitles import Subtitle
    from synth.language.subtitles.findings import LeftOut
    from synth.language.subtitles.read import Terms
    from synth.planning.alignment.score import Judged
    from synth.planning.prosody.pacing import Pace
    from synth.planning.prosody.simulation import PerformerChoice
    from synth.planning.scoring.text_score import OnWord, Reading


def reading_of(args: argparse.Namespace) -> "Reading":
    """Return what `add_reading` and `add_pace` read."""
    from codec.cues.cueing import CueingOptions
    from synth.language.text.lexicon import read_user_lexicon
    from synth.language.text.pronounce import Style
    from synth.planning.scoring.text_score import Reading

    given = {"un": args.un, "schwa": args.schwa, "oe": args.oe, "rest_gap_s": args.rest_gap}
    return Reading(
        CueingOptions(**{k: v for k, v in given.items() if v is not None}),
        Style(liaison=args.liaison, final_schwa=args.final_schwa),
        read_user_lexicon(args.lexicon) if args.lexicon else {},
        pace_of(args),
        _performing(args),
    )


def _performing(args: argparse.Namespace) -> "PerformerChoice":
    """Return the cuer, where the command has options for that."""
    from synth.planning.prosody.simulation import CLAIRE, PerformerChoice

    if "voice" not in args:
        return CLAIRE
    return PerformerChoice(args.voice, args.seed, args.alignment)


def pace_of(args: argparse.Namespace) -> "Pace | None":
    """Return the cuer's own clock, unless she keeps in step with the speaker."""
    from synth.planning.prosody.pacing import Pace

    # Who asks for speech, or for the times of a recording, gets those of a speaker.
    spoken = getattr(args, "speech", None) or isinstance(args.align, str)
    usual = "sync" if spoken else "readable"
    if (args.pace or usual) == "sync":
        return None
    return Pace(args.max_lag, args.syllables_per_second, args.keys_per_second)


def score_of(args: argparse.Namespace, on_word: "OnWord") -> "Score":
    """Return the score of the input of `add_text` and `add_reading`; `on_word` gets each word."""
    if args.text is not None:
        from synth.planning.scoring.text_score import score_of_text

        _note_language(args.text)
        return score_of_text(args.text, start_s=REST_S, reading=reading_of(args), on_word=on_word)
    return score_of_file(args, args.file, on_word)


def _note_language(text: str) -> None:
    """Warn where a text is plainly not French: it is cued by the rules of French all the same."""
    from synth.language.subtitles.language import FRENCH, languages

    (language,) = languages([text], [""])
    if language != FRENCH:
        note(f"note: this looks like another language ({language}); it is cued as French")


def pieces_of(
    args: argparse.Namespace, recording: str | None, judged: "Judged", on_word: "OnWord"
) -> "tuple[Iterator[Score], float | None]":
    """Return the score of what `add_text` and `add_reading` read in pieces, and its length.

    The length in seconds, where it is known, is for showing progress. With a recording the
    score follows its voices, and `judged` gets the confidence; `on_word` is called for each word.
    """
    from cuecast.dubbing.aligning import aligned_pieces, text_as_subtitle
    from synth.planning.scoring.text_score import stream_score

    if args.text is not None and recording is None:
        score = score_of(args, on_word)
        return iter([score]), score.phones[-1].end if score.phones else None
    if args.text is not None:
        assert recording is not None
        subtitles = [text_as_subtitle(args.text, recording)]
    else:
        subtitles = subtitles_of(args.file, terms_of(args))
    length_s = max((subtitle.end_s for subtitle in subtitles), default=None)
    reading = reading_of(args)
    if recording is None:
        return stream_score(subtitles, reading=reading, warn=note, on_word=on_word), length_s
    pieces = aligned_pieces(
        subtitles, recording, reading=reading, warn=note, judged=judged, on_word=on_word
    )
    return pieces, length_s


def score_of_file(args: argparse.Namespace, path: str, on_word: "OnWord") -> "Score":
    """Return the score of what `subtitles_of` reads."""
    from synth.planning.scoring.text_score import score_of_subtitles

    subtitles = subtitles_of(path, terms_of(args))
    return score_of_subtitles(subtitles, warn=note, reading=reading_of(args), on_word=on_word)


def terms_of(args: argparse.Namespace) -> "Terms":
    """Return what `add_subtitle_terms` read."""
    from synth.language.subtitles.read import Terms

    return Terms(args.strict, args.offset, args.everything, args.subtitle_profile)


def subtitles_of(
    path: str,
    terms: "Terms",
    *,
    stream_s: float | None = None,
    player_s: float = 0.0,
    length_s: float | None = None,
    left_out: "LeftOutNotes | None" = None,
) -> "list[Subtitle]":
    """Return the subtitles of a file, or of the standard input for ``-``.

    `stream_s` is the MPEG-2 time at which a player begins with their programme, `player_s` how
    much later the programme's clock begins, `length_s` how long it is, if they have one. Skipped
    parts of the file go to `left_out`, or else are reported at once.
    """
    from synth.language.subtitles import read_subtitles
    from synth.language.subtitles.read import LARGEST_BYTES, parse_subtitles

    told = LeftOutNotes() if left_out is None else left_out
    if path == PIPE:
        found = parse_subtitles(
            read_bytes(PIPE, LARGEST_BYTES + 1),
            stream_s=stream_s,
            player_s=player_s,
            length_s=length_s,
            terms=terms,
            left_out=told,
        )
    else:
        found = read_subtitles(
            path,
            stream_s=stream_s,
            player_s=player_s,
            length_s=length_s,
            terms=terms,
            left_out=told,
        )
    if left_out is None:
        told.say()
    return found


class LeftOutNotes:
    """What of a subtitle file was left out, for the command line and for reports."""

    _SHOWN = 8

    def __init__(self) -> None:
        self._items: list[LeftOut] = []

    def __call__(self, item: "LeftOut") -> None:
        """Remember a part of the file."""
        self._items.append(item)

    def say(self) -> None:
        """Report skipped parts on the standard error: the first ones, and their number."""
        for item in self._items[: self._SHOWN]:
            note(f"left out: {item}")
        if len(self._items) > self._SHOWN:
            note(f"left out: {len(self._items)} subtitles in all")

    def report(self) -> list[dict[str, Any]]:
        """Return all of it for a JSON document."""
        return [
            {"line": item.line, "reason": item.reason}
            | ({"column": item.column} if item.column else {})
            for item in self._items
        ]


def unknown_report(subtitles: "Sequence[Subtitle]", reading: "Reading") -> list[dict[str, Any]]:
    """Return the words with rule-based pronunciation for a JSON document."""
    from synth.planning.scoring.unknown import unknown_words

    return [
        {"word": w.text, "phones": "".join(w.phones), "count": w.count, "line": w.line}
        for w in unknown_words(subtitles, reading)
    ]
