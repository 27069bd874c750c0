"""Timed text in XML: EBU-TT-D, IMSC and their relatives.

The XML is parsed here, so that document type declarations (and with them entity bombs) are
refused and every message has a line; ttconv turns the tree into its model.
"""

import re
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.parsers import expat

from codec.errors import CueError
from synth.subtitles.model import Subtitle
from synth.subtitles.model_walk import subtitles_of

DEEPEST = 100
"""Nested elements that are followed; real files have fewer than ten."""

_TIMES = ("begin", "end", "dur")
_TIME = re.compile(
    r"\d{2,}:[0-5]\d:[0-5]\d(?:\.\d+|:\d{2,}(?:\.\d+)?)?|\d+(?:\.\d+)?(?:h|m|s|ms|f|t)"
)


def read_ttml(data: bytes) -> Iterator[Subtitle]:
    """Yield the subtitles of an XML file, in the order of the file.

    Raises
    ------
    CueError
        If the XML or a time is malformed; the message gives the line.
    """
    from ttconv.imsc import reader

    tree = _Tree()
    root = tree.parse(data)
    try:
        document = reader.to_model(ElementTree.ElementTree(root))
    except Exception as error:  # ttconv documents none and raises many
        raise CueError(f"line 1: not a timed-text document: {error}".split("\n")[0]) from error
    if document is None:
        raise CueError(f"line 1: the document's root is {root.tag.rpartition('}')[2]!r}, not 'tt'")
    yield from subtitles_of(document, iter(tree.paragraph_lines))


class _Tree:
    """An element tree, and the lines on which its paragraphs start."""

    def __init__(self) -> None:
        self.paragraph_lines: list[int] = []
        self._builder = ElementTree.TreeBuilder()
        self._depth = 0
        self._parser = expat.ParserCreate(namespace_separator="}")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._builder.data
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype

    def parse(self, data: bytes) -> ElementTree.Element:
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as error:
            text = expat.errors.messages[error.code]
            raise CueError(f"line {error.lineno}: malformed XML: {text}") from error
        except (LookupError, UnicodeError) as error:
            raise CueError(f"line 1: unknown encoding: {error}") from error
        return self._builder.close()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        line = self._parser.CurrentLineNumber
        self._depth += 1
        if self._depth > DEEPEST:
            raise CueError(f"line {line}: more than {DEEPEST} elements inside each other")
        for key in _TIMES:
            if key in attributes and not _TIME.fullmatch(attributes[key]):
                raise CueError(f"line {line}: malformed {key} {attributes[key][:40]!r}")
        qualified = {_qualify(key): value for key, value in attributes.items()}
        if name.rpartition("}")[2] == "p":
            self.paragraph_lines.append(line)
        self._builder.start(_qualify(name), qualified)

    def _end(self, name: str) -> None:
        self._depth -= 1
        self._builder.end(_qualify(name))

    def _refuse_doctype(self, *_: object) -> None:
        line = self._parser.CurrentLineNumber
        raise CueError(f"line {line}: a document type declaration, which timed text must not have")


def _qualify(name: str) -> str:
    return f"{{{name}" if "}" in name else name
