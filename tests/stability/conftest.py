"""These tests use the problems and the independent check of the solver's unit tests, and the loop in one process of the environment's."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent.parent / room) for room in ("shape_server", "env_server")]
