"""Run `python -m cuecast`."""

import sys

from cuecast.cli import main

sys.exit(main())
