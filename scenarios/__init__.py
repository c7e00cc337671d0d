"""What to simulate, and the programs that do it: scene files, postures, the launcher, the command line."""

from __future__ import annotations

from .load import load as load
