"""How much a listener would notice: perceptual and plain measures of marked sound.

`PeaqMeter` and `grade` compare a test signal against its reference after Recommendation
ITU-R BS.1387 (basic version), `AdvancedMeter` and `peaq_advanced` after its advanced version;
`snr_db`, `segmental_snr_db` and `pesq_wb` stand beside them.

In: a test signal and its reference, in blocks. Out: grades, levels and ratios. May import: no other
room.
"""

from watermark.quality.advanced import AdvancedMeter, AdvancedResult, peaq_advanced
from watermark.quality.advanced_movs import AdvancedMovs
from watermark.quality.movs import Movs
from watermark.quality.peaq import PeaqMeter, PeaqResult, grade
from watermark.quality.snr import pesq_wb, segmental_snr_db, snr_db

__all__ = [
    "AdvancedMeter",
    "AdvancedMovs",
    "AdvancedResult",
    "Movs",
    "PeaqMeter",
    "PeaqResult",
    "grade",
    "peaq_advanced",
    "pesq_wb",
    "segmental_snr_db",
    "snr_db",
]
