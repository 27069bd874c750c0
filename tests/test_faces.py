"""The packages' faces: what others may import, and that importing stays cheap."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

import cuecast

ROOT = Path(__file__).resolve().parents[1]

ENTRIES = {
    "codec": """BitstreamError CueError Key Motion Phone Score SuperframeDecoder SuperframeEncoder
        Voice VoiceError compare_motions decode_stream encode_stream inspect_stream
        load_language load_motion load_voice save_motion save_voice""",
    "synth": """CaptureOptions Subtitle align capture_motion keys_of motion_of read_subtitles
        score_of_subtitles score_of_text sound_of""",
    "watermark": """PROFILES AudioEmbedder AudioReceiver ReceivedSuperframe VideoEmbedder
        VideoReceiver grade""",
    "receiver": """Event KeysFound MotionPiece Receiver StateChanged SuperframeLost
        Unreadable draw""",
    "cuecast": """DubOptions GivenMotion Reception SynthesisedMotion dub main receive""",
}
"""The names that a program begins with, by package. What leaves a face breaks programs."""

VALUES = {
    "codec": """Announcement Chain Comparison CueingOptions DecodedSuperframe FaceModel GestureTable
        HandModel Language ScorePart SigningKey SlowSender Superframe Window""",
    "synth": """Captured Judgement LeftOut Pace PacedWord PerformerChoice Reading Style Terms
        TextRun TimedWord Variant Word""",
    "watermark": """AudioProfile CodecLoop CodecStream EmbedReport Movs PeaqResult
        PictureCoder SuperframeMargin TriedChannel VideoProfile VideoReport""",
    "receiver": """AuthenticityChanged Trust""",
    "cuecast": """MotionSource""",
}
"""The types in their signatures."""

FACES = {package: f"{ENTRIES[package]} {VALUES[package]}" for package in ENTRIES}

HEAVY = {"numpy", "scipy", "numba", "av", "aiohttp", "matplotlib", "soundfile"}


@pytest.mark.parametrize("package", FACES)
def test_the_face_is_as_promised(package: str) -> None:
    module = importlib.import_module(package)
    assert sorted(module.__all__) == sorted(FACES[package].split())
    assert set(dir(module)) >= set(module.__all__)
    for name in module.__all__:
        assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = module.nonsense


@pytest.mark.parametrize("package", FACES)
def test_no_name_hides_a_room(package: str) -> None:
    """A room that is imported becomes an attribute of its package, in the name's place."""
    rooms = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert rooms.isdisjoint(FACES[package].split())


@pytest.mark.parametrize("package", FACES)
def test_types_and_homes_agree(package: str) -> None:
    """What type checkers are told to be imported is what is imported."""
    module = importlib.import_module(package)
    tree = ast.parse((ROOT / package / "__init__.py").read_text(encoding="utf-8"))
    told, hidden = (node for node in tree.body if isinstance(node, ast.If))
    assert (ast.unparse(told.test), ast.unparse(hidden.test)) == (
        "TYPE_CHECKING",
        "not TYPE_CHECKING",
    )
    # Were it not hidden, type checkers would take any misspelt name for one of ours.
    assert [getattr(node, "name", "") for node in hidden.body] == ["__getattr__"]
    typed = {}
    for node in told.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            assert alias.asname is None, f"{package}.{alias.asname} is an alias"
            typed[alias.name] = node.module
    assert typed == module._HOMES


def test_importing_the_faces_is_cheap() -> None:
    """None of the heavy libraries is loaded before it is needed."""
    program = f"import sys, {', '.join(FACES)}; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("package", FACES)
def test_the_face_has_an_example(package: str) -> None:
    assert ">>> from " in (importlib.import_module(package).__doc__ or "")


def exemplified(thing: Any) -> str:
    """Return the docstring of a public name, with those of a class's own members."""
    members = vars(thing).values() if inspect.isclass(thing) else ()
    return "".join(str(getattr(part, "__doc__", "")) for part in (thing, *members))


@pytest.mark.parametrize("package", FACES)
def test_every_public_name_has_an_example(package: str) -> None:
    """Of its own, or in the example of its package; the suite runs them all."""
    module = importlib.import_module(package)
    own = re.sub(r"(?m)^(?!\s*(>>>|\.\.\.)).*$", "", module.__doc__ or "")
    bare = [
        name
        for name in module.__all__
        if ">>> " not in exemplified(getattr(module, name)) and not re.search(rf"\b{name}\b", own)
    ]
    assert bare == []


def undocumented(label: str, thing: Any) -> list[str]:
    """Return what the docstring of a public function or method does not tell."""
    text = inspect.getdoc(thing) or ""
    signature = inspect.signature(thing)
    missing = []
    if set(signature.parameters) - {"self", "cls"} and "Parameters" not in text:
        missing.append(f"{label}: Parameters")
    gives = signature.return_annotation not in (None, "None", inspect.Signature.empty)
    if gives and "Returns" not in text and "Yields" not in text:
        missing.append(f"{label}: Returns")
    return missing


@pytest.mark.parametrize("package", FACES)
def test_public_names_tell_what_they_take_and_give(package: str) -> None:
    module = importlib.import_module(package)
    missing = []
    for name in ENTRIES[package].split():
        thing = getattr(module, name)
        if inspect.isfunction(thing):
            missing += undocumented(name, thing)
        elif inspect.isclass(thing) and not issubclass(thing, Exception):
            text = inspect.getdoc(thing) or ""
            if "Parameters" not in text and "Attributes" not in text:
                missing.append(f"{name}: Parameters or Attributes")
            for label, method in vars(thing).items():
                method = getattr(method, "__func__", method)
                if inspect.isfunction(method) and not label.startswith("_"):
                    missing += undocumented(f"{name}.{label}", method)
    assert missing == []


@pytest.mark.parametrize("package", FACES)
def test_values_say_what_they_hold(package: str) -> None:
    for name in VALUES[package].split():
        assert len(inspect.getdoc(getattr(importlib.import_module(package), name)) or "") > 20


def test_types_of_signatures_are_in_a_face() -> None:
    """Whatever a public function or method takes or gives can be imported from a face."""
    public = [getattr(importlib.import_module(p), name) for p in FACES for name in FACES[p].split()]
    known = {thing for thing in public if isinstance(thing, type)}
    missing = {
        f"{found.__module__}.{found.__name__} in {thing.__name__}"
        for thing in public
        if callable(thing) and not is_error(thing)
        for found in types_of_ours(thing)
        if found not in known
    }
    assert missing == set()


def is_error(thing: Any) -> bool:
    return isinstance(thing, type) and issubclass(thing, Exception)


def types_of_ours(thing: Any) -> set[type]:
    """Return the project's own types in the annotations of a function, or of a class's public
    attributes and methods."""
    functions = [thing]
    if isinstance(thing, type):
        members = [m for name, m in vars(thing).items() if not name.startswith("_")]
        members = [getattr(m, "fget", getattr(m, "__func__", m)) for m in members]
        functions += [vars(thing).get("__init__"), *members]
    found: set[type] = set()
    for function in functions:
        if isinstance(function, type) or inspect.isfunction(function):
            for name, annotation in hints_of(function).items():
                if not name.startswith("_"):
                    found |= ours_in(annotation)
    return found


def ours_in(annotation: Any) -> set[type]:
    if isinstance(annotation, type) and annotation.__module__.split(".")[0] in FACES:
        return {annotation}
    if isinstance(annotation, list):  # the parameters of a Callable
        return {found for one in annotation for found in ours_in(one)}
    return {found for one in get_args(annotation) for found in ours_in(one)}


def hints_of(thing: Any) -> dict[str, Any]:
    """Return resolved annotations; names that only type checkers import are looked up, too."""
    module = sys.modules[thing.__module__]
    names = dict(vars(module))
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for one in node.body:
                assert isinstance(one, ast.ImportFrom)
                assert one.module
                home = importlib.import_module(one.module)
                names |= {a.asname or a.name: getattr(home, a.name) for a in one.names}
    return get_type_hints(thing, names)


def test_one_version() -> None:
    assert cuecast.__version__ == version("cuecast")
