import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.cues.phonology import PHONES
from codec.cues.score import Key, Phone, Score
from cuecast.evaluate.models_fits import ModelFit
from cuecast.evaluate.segmentation import write_page
from cuecast.evaluate.takes import EvaluatedTake
from synth.planning.scoring.textgrid import read_textgrid
from tests.chromium import browse

RATE_HZ = 120.0
ARTEFACTS = Path(__file__).resolve().parents[3] / "artefacts" / "segmentation"
SCORE = Score(
    (Phone("b", 0.5, 0.7), Phone("ɔ̃", 0.7, 1.0), Phone("a", 1.4, 1.8)),
    (Key(0.5, 1.0, ("b", "ɔ̃"), 4, "mouth"), Key(1.4, 1.8, ("a",), 5, "side")),
)


class Even:
    """A recogniser that knows nothing."""

    def shape_posteriors(self, markers: np.ndarray) -> np.ndarray:
        return np.full((len(markers), 9), 1 / 9)

    def placement_posteriors(self, markers: np.ndarray, shape: np.ndarray) -> np.ndarray:
        return np.full((len(markers), 6), 1 / 6)


@pytest.fixture
def page(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    markers = rng.normal(0, 80, (240, 113, 3)).astype(np.float32)
    observed = markers.copy()
    observed[10:20, 70] = np.nan
    sound = rng.normal(0, 0.1, 16000 * 2).astype(np.float32)
    take = EvaluatedTake("corpus3/s<1>", RATE_HZ, observed, None, SCORE, sound, 16000, None)
    fit = ModelFit(take.name, 1.0, 1.0, 1.0, 1.0, markers, markers[:, 63:], 2.0, 0.1)
    write_page(tmp_path / "page.html", "tests </script>", take, fit, Even())  # type: ignore[arg-type]
    return tmp_path / "page.html"


def test_labels_are_corrected_and_saved(page: Path, tmp_path: Path) -> None:
    async def correct() -> tuple[Any, ...]:
        async with browse(page.as_uri(), 1300, 740) as tab:
            await tab.until("typeof textgrid === 'function' && document.readyState === 'complete'")
            title = await tab.evaluate("document.getElementById('title').textContent")
            before = await tab.evaluate("textgrid()")
            await tab.evaluate("chosen = ['keys', 0]; go(0.6)")
            write = (
                "(t => { $('text').value = t; $('text').dispatchEvent(new Event('input'));"
                " return $('note').textContent; })"
            )
            refused = [await tab.evaluate(f"{write}({text!r})") for text in ("99 b", "24 q", "24")]
            accepted = await tab.evaluate(f"{write}('34 b ɔ̃')")
            await tab.screenshot(ARTEFACTS / "page.png")
            drag = "line.dispatchEvent(new PointerEvent('pointer%s', {clientX: line.getBoundingClientRect().left + x(%s), clientY: line.getBoundingClientRect().top + KEYS_TOP + 9, pointerId: 1}))"  # noqa: E501
            await tab.evaluate("line.setPointerCapture = () => {}")
            for step in (("down", 1.0), ("move", 1.2), ("up", 1.2)):
                await tab.evaluate(drag % step)
            return title, before, refused, accepted, await tab.evaluate("textgrid()"), tab.errors

    title, before, refused, accepted, after, errors = asyncio.run(correct())
    assert errors == []
    assert title == "corpus3/s<1> (tests </script>)"
    assert refused == [
        "“99” is not placement 0-5 and shape 0-8",
        "“q” is no phone",
        "a key has one or two phones",
    ]
    assert accepted == ""
    (tmp_path / "before.TextGrid").write_text(before, encoding="utf-8")
    (tmp_path / "after.TextGrid").write_text(after, encoding="utf-8")
    assert read_textgrid(tmp_path / "before.TextGrid") == SCORE
    found = read_textgrid(tmp_path / "after.TextGrid")
    assert found.phones == SCORE.phones
    assert (found.keys[0].placement, found.keys[0].shape) == ("chin", 4)
    assert found.keys[0].end == pytest.approx(1.2, abs=0.01)
    assert found.keys[1] == SCORE.keys[1]


def test_all_phones_may_be_written(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert all(f'"{phone}"' in text for phone in PHONES)
    assert text.count("</script>") == 2
