"""Where the data of the format are: tables, voices, coding tables.

In a checkout they are in ``spec/data``, beside the text that states them; a wheel carries the same
files in ``codec/data``. Every package finds them here.
"""

from pathlib import Path

_PACKAGED = Path(__file__).parents[1] / "data"

DATA = _PACKAGED if _PACKAGED.exists() else Path(__file__).parents[2] / "spec" / "data"
"""Folder of ``tables.json``, ``languages``, ``voices`` and ``coding``."""
