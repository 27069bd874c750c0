"""The packages' faces: what others may import, and that importing stays cheap."""

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]

FACES = {
    "codec": """BitstreamError CueError Key Motion Phone Score SuperframeDecoder SuperframeEncoder
        Voice VoiceError compare_motions decode_stream encode_stream inspect_stream load_motion
        load_voice save_motion save_voice""",
    "synth": """CaptureOptions Subtitle align capture_motion keys_of motion_of read_subtitles
        score_of_subtitles score_of_text sound_of""",
    "watermark": """AudioEmbedder AudioReceiver PROFILES ReceivedSuperframe VideoEmbedder
        VideoReceiver grade""",
    "receiver": """Event KeysFound MotionPiece Receiver StateChanged SuperframeLost Unreadable
        draw""",
    "cuecast": """DubOptions GivenMotion Reception SynthesisedMotion dub main receive""",
}
"""The faces of this version. They follow semantic versioning: what leaves one breaks programs."""

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
        "TYPE_CHECKING", "not TYPE_CHECKING",
    )  # fmt: skip
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
    for name in module.__all__:
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
