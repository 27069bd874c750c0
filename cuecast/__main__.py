"""Run `python -m cuecast`."""

import sys

from cuecast.command.cli import main

sys.exit(main())
