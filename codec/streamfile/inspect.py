"""Inspection: a stream file's fields, without a voice, as a document and as text."""

from typing import Any

from bitstring import Bits

from codec.cues.timeline import SUPERFRAME_S, TICK_S
from codec.errors import BitstreamError, check_kind
from codec.streamfile.content import read_content
from codec.streamfile.file_score import read_common
from codec.superframe.bitmap import Field, map_superframe
from codec.superframe.bits import FILE_BYTES, FILE_FIELDS, MODES, PLAIN, SCORE, unpack_fields
from codec.superframe.checks import is_own
from codec.superframe.merging import score_of
from codec.superframe.payload import read_beginning
from codec.superframe.quantise import LEVELS, NO_RESIDUAL, SHARES, Setting, width_mm
from codec.superframe.range_coder import RangeDecoder
from codec.superframe.resynthesis.trajectory import SHIFTS
from codec.superframe.score_coding import ScorePart, part_of
from codec.superframe.settings import read_setting
from codec.superframe.superframe import Superframe
from codec.superframe.window import Window

BASES = ("residual", "loose", "plain", "filmed")
"""Names of the bases."""


def inspect_stream(data: bytes, *, partial: bool = False) -> dict[str, Any]:
    """Return the fields of a stream file.

    Parameters
    ----------
    data : bytes
    partial : bool
        Return the fields of a damaged file up to its damage, and this as ``damage``; where the head
        is damaged, its fields as they stand, as ``head``.

    Returns
    -------
    dict
        ``coding``, ``start_s``, ``duration_s``, ``rate_bps`` (all bytes counted), ``learning``,
        ``superframes`` (one dict each) and ``keys``; ready for JSON. ``damage``, of a damaged file
        alone: ``rule``, ``section``, ``bit`` and ``cause``.

    Raises
    ------
    BitstreamError
        If the file breaks a rule. A wrong checksum of a superframe is reported in its place.

    Examples
    --------
    >>> from codec import encode_stream, load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> stream = encode_stream(motion_of(score_of_text("Oui"), voice), voice, error_mm=4.0)
    >>> inspect_stream(stream + b"x", partial=True)["damage"]["cause"]
    '1 bytes were appended to a file that is whole without them'
    """
    check_kind(data, bytes, "inspect_stream", "the content of a file, not its name")
    try:
        content = read_content(data)
    except BitstreamError as error:
        if not partial:
            raise
        return {"head": _head_as_it_stands(data), "damage": _damage(error)}
    head, fault = content.head, content.fault
    if fault is not None and not partial:
        raise fault
    parts: dict[int, ScorePart | Window] = {}
    rows = list[dict[str, Any]]()
    learning = False
    try:
        common = read_common(content.common, head.indices)
        learning = common.learning
        if common.line is not None:
            parts |= {k: part_of(common.line, k, common.options) for k in head.indices}
        # Streams of constant size hold whole superframes, others records that share the common
        # score.
        for frame in content.superframes:
            if head.l0:
                row, part = _row(frame, head.coding)
                if part is not None:
                    parts[frame.index] = part
            else:
                row = _record_row(frame, parts.get(frame.index))
            rows.append(row)
    except BitstreamError as error:
        if not partial:
            raise
        fault = fault or error
    duration_s = head.ticks * TICK_S
    document = {
        "coding": head.coding,
        "start_s": round(head.first_tick * TICK_S, 2),
        "duration_s": round(duration_s, 2),
        "rate_bps": round(8 * len(data) / duration_s, 1),
        "learning": learning,
        "superframes": rows,
        "keys": [key.as_dict() for key in score_of(parts).keys],
    }
    if fault is not None:
        document["damage"] = _damage(fault)
    return document


def _damage(fault: BitstreamError) -> dict[str, Any]:
    return {name: getattr(fault, name) for name in ("rule", "section", "bit", "cause")}


def _head_as_it_stands(data: bytes) -> dict[str, int]:
    return unpack_fields(FILE_FIELDS, data[:FILE_BYTES]) if len(data) >= FILE_BYTES else {}


def _row(frame: Superframe, coding: str) -> tuple[dict[str, Any], ScorePart | Window | None]:
    row: dict[str, Any] = {
        "index": frame.index,
        "start_s": round(frame.index * SUPERFRAME_S, 2),
        "l0_bytes": len(frame.l0),
        "l1_bytes": len(frame.l1),
        "intact": is_own(frame.l0, coding),
    }
    if not row["intact"]:
        return row, None
    try:
        content = read_beginning(frame.l0)
    except BitstreamError as error:
        return row | {"error": str(error)}, None
    header, part = content.header, content.part
    row |= {"mode": MODES[header.mode], "sequence": header.sequence, "lead": header.lead}
    row |= _said(content.setting)
    row["slow"] = list(content.slow)
    row["previews"] = sorted(frame.index + distance for distance in content.previews if distance)
    return row | _spoken(frame.index, part), part


def _record_row(frame: Superframe, part: ScorePart | Window | None) -> dict[str, Any]:
    """Return the fields of a superframe whose file has one score for all."""
    mode = PLAIN if part is None else SCORE
    row: dict[str, Any] = {
        "index": frame.index,
        "start_s": round(frame.index * SUPERFRAME_S, 2),
        "l0_bytes": len(frame.l0),
        "l1_bytes": 0,
        "intact": True,
        "mode": MODES[mode],
    }
    setting = read_setting(RangeDecoder(frame.l0), mode)
    return row | _said(setting) | _spoken(frame.index, part)


def _said(setting: Setting) -> dict[str, Any]:
    return {
        "step": None if setting.step == NO_RESIDUAL else round(width_mm(setting.step), 2),
        "basis": BASES[setting.basis],
        "raised": LEVELS[setting.level],
        "course": setting.course,
        "shift_ticks": SHIFTS[setting.shift],
        "shares": [SHARES[share] for share in setting.shares],
    }


def _spoken(index: int, part: ScorePart | Window | None) -> dict[str, Any]:
    if part is None:
        return {}
    score = score_of({index: part})
    return {
        "phones": [phone.symbol for phone in score.phones],
        "keys": [str(key) for key in score.keys],
    }


def describe(document: dict[str, Any]) -> str:
    """Return the document of `inspect_stream` as lines of text."""
    damage = [BitstreamError(**document["damage"]).explain()] if "damage" in document else []
    if "head" in document:
        return "\n".join([f"{name} {value:x}" for name, value in document["head"].items()] + damage)
    lines = [
        "coding {coding}, {duration_s} s from {start_s} s, {rate_bps} bit/s".format(**document),
        "  index    start  mode        bytes  step  phones | keys",
    ]
    for row in document["superframes"]:
        size = f"{row['l0_bytes']}+{row['l1_bytes']}"
        if "mode" not in row:
            lines.append(f"{row['index']:7d} {row['start_s']:8.2f}  damaged  {size:>8s}")
            continue
        step = "-" if row["step"] is None else f"{row['step']:.0f}"
        said = " ".join(row.get("phones", [])) + " | " + " ".join(row.get("keys", []))
        place = f"{row['index']:7d} {row['start_s']:8.2f}  {row['mode']:10s}"
        lines.append(f"{place} {size:>6s} {step:>5s}  {said}")
    return "\n".join(lines + damage)


_COLOURS = (36, 33, 32, 35, 34, 31)
"""Foreground colours of neighbouring fields, by the numbers of ECMA-48 (SGR)."""

_BITS_IN_LINE = 64
"""Bits that a line of the map shows."""


def describe_bits(
    frame: Superframe, *, fields: list[Field] | None = None, colour: bool = False
) -> str:
    """Return the bit map of a superframe as lines of text.

    Parameters
    ----------
    frame : Superframe
    fields : list of Field, optional
        Of a superframe whose file has one score for all; default: those of one as on air.
    colour : bool
        Paint each field and its bits alike, for a terminal.

    Returns
    -------
    str
        A line per field (first bit, length, name, value, paragraph), then the bits of each part.

    Raises
    ------
    BitstreamError
        As `map_superframe`.
    """
    fields = map_superframe(frame) if fields is None else fields
    lines = [
        f"superframe {frame.index}",
        "      bit   bits  field         value           paragraph",
    ]
    for number, field in enumerate(fields):
        text = f"{field.part} {field.first:6.1f} {field.bits:6.1f}  {field.name:12s}  "
        text += f"{field.value:14s}  {field.paragraph}"
        lines.append(_painted(text.rstrip(), number, colour))
    for part, data in (("L0", frame.l0), ("L1", frame.l1)):
        owners = [(n, f) for n, f in enumerate(fields) if f.part == part]
        for first in range(0, 8 * len(data), _BITS_IN_LINE):
            line = Bits.from_bytes(data)[first : first + _BITS_IN_LINE].bin
            lines.append(f"{part} {first:4d}  {_painted_bits(line, first, owners, colour)}")
    return "\n".join(lines)


def _painted_bits(line: str, first: int, owners: list[tuple[int, Field]], colour: bool) -> str:
    """Return bits in groups of eight, each in the colour of the field where it begins."""
    text = ""
    for i, bit in enumerate(line):
        at = first + i
        number = next(n for n, field in reversed(owners) if field.first <= at)
        text += (" " if i and i % 8 == 0 else "") + _painted(bit, number, colour)
    return text


def _painted(text: str, number: int, colour: bool) -> str:
    return f"\x1b[{_COLOURS[number % len(_COLOURS)]}m{text}\x1b[0m" if colour else text
