"""Why fields of 2 bits do not bear 5 % of loss: the arithmetic of spec/authentication.md."""

from pathlib import Path

import pytest
from scipy.stats import binom

from codec.authentication.layout import CHECK_BITS, LAYOUTS, SENT_BITS, TAG_BITS

TEXT = (Path(__file__).parents[3] / "spec" / "authentication.md").read_text(encoding="utf-8")
LAYOUT = LAYOUTS[2]
LOSS = 0.05


def borne(length: int, quick: int = TAG_BITS) -> float:
    """Return the share of blocks that a perfect code of all bits that arrive would verify."""
    bits = (1 - LOSS) * (LAYOUT.width * length - SENT_BITS - quick)
    return float(binom.cdf(bits // TAG_BITS - 1, length, LOSS))


def test_the_bits_of_a_block_do_not_suffice() -> None:
    mean = LOSS * LAYOUT.block
    fields = CHECK_BITS // LAYOUT.width
    often = int(binom.ppf(0.85, LAYOUT.block, LOSS))
    told = {
        f"Of the {LAYOUT.block} superframes that they cover {mean:.1f} are lost in the mean",
        f"{TAG_BITS * (mean + 1):.0f} bits in the mean, {TAG_BITS * (often + 1)} if 85 of 100",
        f"Of the {LAYOUT.checks} checks {LAYOUT.checks * (1 - LOSS) ** fields:.1f} arrive",
        f"a perfect code would have {(1 - LOSS) * LAYOUT.checks * CHECK_BITS:.0f} bits",
        f"verify {100 * borne(LAYOUT.block):.0f} %\nof the blocks, "
        f"{100 * borne(LAYOUT.block, 0):.0f} % without",
    }
    for sentence in told:
        assert sentence in TEXT, sentence


@pytest.mark.parametrize(("length", "suffices"), [(192, False), (240, True)])
def test_what_blocks_would(length: int, suffices: bool) -> None:
    assert (borne(length) >= 0.85) == suffices
