"""Timed text in XML: EBU-TT-D, IMSC and their relatives.

The XML is parsed here, so that document type declarations (and with them entity bombs) are
refused and every message has a line; ttconv turns the tree into its model.
"""

import re
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.parsers import expat

from codec.errors import CueError
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.model_walk import subtitles_of

DEEPEST = 100
"""Nested elements that are followed; real files have fewer than ten."""

_XML_LANG = "http://www.w3.org/XML/1998/namespace}lang"
_TIME_BASE = "http://www.w3.org/ns/ttml#parameter}timeBase"
_CLOCK = re.compile(r"(\d+):(\d\d):(\d\d)")
_TIMES = ("begin", "end", "dur")
_TIME = re.compile(
    r"\d{2,}:[0-5]\d:[0-5]\d(?:\.\d+|:\d{2,}(?:\.\d+)?)?|\d+(?:\.\d+)?(?:h|m|s|ms|f|t)"
)


_START_OF_PROGRAMME = "documentStartOfProgramme"
"""Element of EBU-TT (EBU Tech 3350) with the time at which the programme starts."""


def read_ttml(data: bytes, findings: Findings) -> Iterator[Subtitle]:
    """Yield the subtitles of an XML file, in the order of the file.

    Parameters
    ----------
    data : bytes
    findings : Findings
        Receives elements whose times cannot be read, where a file breaks off, languages, and
        the start of the programme.

    Raises
    ------
    CueError
        If it is no timed text or nothing can be read; the message gives the line.
    """
    from ttconv.imsc import reader

    tree = _Tree(findings)
    root = tree.parse(data)
    try:
        document = reader.to_model(ElementTree.ElementTree(root))
    except Exception as error:  # ttconv documents none and raises many
        raise CueError(f"line 1: not a timed-text document: {error}".split("\n")[0]) from error
    if document is None:
        raise CueError(f"line 1: the document's root is {root.tag.rpartition('}')[2]!r}, not 'tt'")
    yield from subtitles_of(document, iter(tree.places()), findings)


class _Tree:
    """An element tree, and where its paragraphs start."""

    def __init__(self, findings: Findings) -> None:
        self._paragraphs: list[tuple[int, int]] = []
        self._findings = findings
        self._builder = ElementTree.TreeBuilder()
        self._open: list[str] = []
        self._languages: list[str] = [""]
        self._skipped = 0
        self._parser = expat.ParserCreate(namespace_separator="}")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._data
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype

    def parse(self, data: bytes) -> ElementTree.Element:
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as error:
            reason = f"malformed XML: {expat.errors.messages[error.code]}"
            if not self._paragraphs or self._findings.strict:
                raise CueError(f"line {error.lineno}: {reason}") from error
            self._findings.leave_out(error.lineno, f"{reason}; what follows is not read")
            self._skipped = 0
            while self._open:
                self._builder.end(_qualify(self._open.pop()))
        except (LookupError, UnicodeError) as error:
            raise CueError(f"line 1: unknown encoding: {error}") from error
        return self._builder.close()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        line = self._parser.CurrentLineNumber
        local = name.rpartition("}")[2]
        if len(self._open) + self._skipped >= DEEPEST:
            raise CueError(f"line {line}: more than {DEEPEST} elements inside each other")
        if self._skipped or not self._times_hold(attributes, line):
            self._skipped += 1
            return
        self._languages.append(attributes.get(_XML_LANG, self._languages[-1]))
        if local == "tt":
            self._findings.language = self._languages[-1]
            self._findings.time_of_day = attributes.get(_TIME_BASE) in ("smpte", "clock")
        qualified = {_qualify(key): value for key, value in attributes.items()}
        if local == "p":
            self._paragraphs.append((line, self._parser.CurrentColumnNumber + 1))
        self._open.append(name)
        self._builder.start(_qualify(name), qualified)

    def places(self) -> list[tuple[int, int]]:
        """Return line and column of each paragraph; the column is 0 where none shares its line."""
        shared = Counter(line for line, _ in self._paragraphs)
        return [(line, column if shared[line] > 1 else 0) for line, column in self._paragraphs]

    def _times_hold(self, attributes: dict[str, str], line: int) -> bool:
        for key in _TIMES:
            if key in attributes and not _TIME.fullmatch(attributes[key]):
                self._findings.leave_out(line, f"malformed {key} {attributes[key][:40]!r}")
                return False
        return True

    def _data(self, text: str) -> None:
        if self._skipped:
            return
        self._builder.data(text)
        if self._open[-1].endswith(_START_OF_PROGRAMME) and (clock := _CLOCK.match(text.strip())):
            hours, minutes, seconds = (int(field) for field in clock.groups())
            self._findings.start_s = 3600.0 * hours + 60 * minutes + seconds

    def _end(self, name: str) -> None:
        if self._skipped:
            self._skipped -= 1
            return
        self._languages.pop()
        self._builder.end(_qualify(self._open.pop()))

    def _refuse_doctype(self, *_: object) -> None:
        line = self._parser.CurrentLineNumber
        raise CueError(f"line {line}: a document type declaration, which timed text must not have")


def _qualify(name: str) -> str:
    return f"{{{name}" if "}" in name else name
