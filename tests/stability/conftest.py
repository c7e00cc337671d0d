"""These tests use the problems and the independent check of the solver's unit tests."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "shape_server"))
