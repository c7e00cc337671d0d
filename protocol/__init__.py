"""The words the programs share: scenes, messages, and how they travel."""

from __future__ import annotations

from typing import Final

PROJECT: Final = "cablecosim"
"""Tells this package from the unrelated distribution on PyPI whose import name is also ``protocol``."""

VERSION: Final = 5
"""Version of the messages; programs with different versions refuse each other with a sentence."""
