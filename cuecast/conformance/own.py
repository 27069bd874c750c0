"""The toolkit's own decoder as a program of the protocol: ``python -m cuecast.conformance.own``."""

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from codec.cuer.voice import Voice, load_voice
from codec.cues.score import PLACEMENT_NUMBER
from codec.cues.timeline import TICK_S, TICKS
from codec.errors import BitstreamError, CueError
from codec.streamfile.content import common_data, read_head, read_superframes
from codec.streamfile.stream import decode_stream
from codec.superframe.bits import read_header
from codec.superframe.checks import is_compact, is_own, is_possible, proof_of
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.merging import join_line, score_of
from codec.superframe.payload import Content, read_l0, read_l1
from codec.superframe.quantise import NO_RESIDUAL, basis_of, dequantise_integers
from codec.superframe.score_coding import REST_GAPS_S, ScorePart, part_of
from codec.superframe.superframe import DecodedSuperframe
from codec.superframe.tables import coefficient_tables
from codec.superframe.transform import Bases, Basis
from codec.superframe.window import Window

BUILT_IN = {
    "python": [sys.executable, "-m", "cuecast.conformance.own"],
    "reference": [sys.executable, "-m", "spec.reference.conform"],
}
"""Commands of the decoders that `cuecast conform` knows by name."""

Answer = dict[str, Any]


class Own:
    """Answers requests with the codec of this package."""

    def __init__(self) -> None:
        self._bases: Bases = ()
        self._identity = ""
        self._voice: Voice | None = None
        self._decoders: dict[bool, SuperframeDecoder] = {}
        self._seen: dict[int, DecodedSuperframe] = {}
        self.requests: dict[str, Callable[[Answer], Answer]] = {
            "hello": self.hello,
            "voice": self.voice,
            "bases": self.bases,
            "superframe": self.superframe,
            "reset": self.reset,
            "push": self.push,
            "draw": self.draw,
            "file": self.file,
        }

    def hello(self, _: Answer) -> Answer:
        """Return what this decoder does."""
        does = ["superframe", "draw", "file"]
        return {"name": "cuecast", "protocol": 1, "format": 4, "does": does}

    def voice(self, request: Answer) -> Answer:
        """Load a voice."""
        self._voice = load_voice(request["voice"])
        return {"loaded": True}

    def bases(self, request: Answer) -> Answer:
        """Take the scales of the vectors' bases."""
        self._identity, channels = request["identity"], request["channels"]
        scales = np.array(request["scales"], dtype=np.int64).reshape(-1, channels, TICKS)
        self._bases = tuple(Basis(np.eye(channels), one) for one in scales)
        return {}

    def superframe(self, request: Answer) -> Answer:
        """Return the integers of a superframe, or the paragraph that it breaks."""
        l0, l1 = bytes.fromhex(request["l0"]), bytes.fromhex(request["l1"])
        try:
            if not is_possible(l0):
                return {"valid": False, "section": "H1"}
            if not is_own(l0, self._identity):
                return {"valid": False, "section": "M2" if is_compact(l0) else "H6"}
            read_header(l0)
            content, known = read_l0(l0, self._bases)
            if l1:
                with suppress(BitstreamError):  # (H7) an L1 of another L0 is left out
                    content = read_l1(l0, l1, content, known, self._bases)
        except BitstreamError as error:
            return {"valid": False, "section": error.section}
        found = proof_of(l0)
        return stated(content, self._bases, found[0] if found else 0)

    def reset(self, _: Answer) -> Answer:
        """Forget all superframes."""
        assert self._voice is not None
        self._decoders = {lips: SuperframeDecoder(self._voice, lips=lips) for lips in (False, True)}
        self._seen = {}
        return {}

    def push(self, request: Answer) -> Answer:
        """Take a superframe; an empty one is lost."""
        l0, l1 = (bytes.fromhex(request[name]) or None for name in ("l0", "l1"))
        for lips, decoder in self._decoders.items():
            try:
                decoder.take(l0, l1, request["index"])
            except CueError:
                continue
            if not lips:
                self._seen[request["index"]] = decoder.render(request["index"])
        return {}

    def draw(self, request: Answer) -> Answer:
        """Return keys and markers of a superframe as far as they are known by now."""
        index = request["index"]
        bare = self._decoders[False]
        if index in self._seen:
            self._seen[index] = bare.render(index)
        parts = {k: part for k in self._seen if (part := bare.render(k).part) is not None}
        keys = [
            [len(PLACEMENT_NUMBER) * key.shape + PLACEMENT_NUMBER[key.placement], start, end]
            for key in score_of(parts).keys
            for start, end in [(round(key.start / TICK_S), round(key.end / TICK_S))]
            if start // TICKS == index
        ]
        markers = {}
        if request["frames"]:
            assert self._voice is not None
            shown = self._decoders[bool(request["lips"])].render(index)
            places = self._voice.reconstruct(shown.params)
            markers = {str(t): np.round(places[t], 4).tolist() for t in request["frames"]}
        return {"arrived": index in self._seen, "keys": keys, "markers": markers}

    def file(self, request: Answer) -> Answer:
        """Return keys, phones and markers of a stream file, or the paragraph that it breaks."""
        data = bytes.fromhex(request["file"])
        try:
            head, common = read_head(data), common_data(data)
            list(read_superframes(data))
        except BitstreamError as error:
            return {"valid": False, "section": error.section}
        keys: list[list[int]] = []
        phones: list[list[int]] = []
        if common.line is not None:
            far = max(common.line.starts) // TICKS + 2
            every = range(-1, max(far, head.indices.stop))
            joined = join_line(
                common.line, {k: part_of(common.line, k, common.options) for k in every}
            )
            phones = [[s.number, s.start, s.end] for s in joined.line if s.number]
            keys = [
                [len(PLACEMENT_NUMBER) * key.shape + PLACEMENT_NUMBER[key.placement], *ticks]
                for key in joined.every
                for ticks in [(round(key.start / TICK_S), round(key.end / TICK_S))]
            ]
        markers = {}
        if request["frames"]:
            assert self._voice is not None
            params = decode_stream(data, self._voice).params
            places = self._voice.reconstruct(params)
            markers = {
                str(t): np.round(places[t - head.first_tick], 4).tolist() for t in request["frames"]
            }
        return {"valid": True, "keys": keys, "phones": phones, "markers": markers}


def stated(content: Content, bases: Bases, proof: int) -> Answer:
    """Return a superframe's content, in the words of the vectors."""
    header, setting = content.header, content.setting
    indices, values = content.q, np.zeros_like(content.q)
    if setting.step != NO_RESIDUAL and len(indices):
        values = dequantise_integers(
            indices, setting, basis_of(bases, setting), coefficient_tables()
        )
    return {
        "valid": True,
        "header": [header.mode, header.sequence, header.lead, int(header.signed), proof],
        "slow": list(content.slow),
        "setting": [
            setting.step,
            setting.basis,
            setting.level,
            setting.course,
            setting.shift,
            *setting.shares,
        ],
        "score": score_words(None if header.filmed else content.part),
        "previews": {
            str(d): [list(start) for start in preview] for d, preview in content.previews.items()
        },
        "indices": {str(i): int(q) for i, q in enumerate(indices) if q},
        "values": {str(i): int(v) for i, v in enumerate(values) if v},
    }


def score_words(part: ScorePart | Window | None) -> Answer | None:
    """Return a score in the words of the vectors."""
    if part is None:
        return None
    cheek = [int(x == "cheek") for x in (part.options.un, part.options.schwa, part.options.oe)]
    both: Answer = {
        "numbers": list(part.numbers),
        "starts": list(part.starts),
        "cheek": cheek,
        "rest_gap": REST_GAPS_S.index(part.options.rest_gap_s),
    }
    if isinstance(part, Window):
        return both | {"begin": part.begin, "end": part.end}
    overrides = {str(k): list(v) for k, v in part.overrides.items()}
    return both | {
        "first": part.first,
        "first_end": part.first_end,
        "ahead": part.ahead,
        "overrides": overrides,
    }


def main() -> None:
    """Answer requests until the input ends."""
    own = Own()
    for line in sys.stdin:
        request = json.loads(line)
        known = own.requests.get(request["do"])
        answer = known(request) if known else {"unsupported": True}
        print(json.dumps(answer, separators=(",", ":")), flush=True)


if __name__ == "__main__":
    main()
