"""Takes of the paper's figures through the three real programs, for tests; all of one figure run once."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from scenarios.paper.reproduce import Reproduced, figures, reproduce


@cache
def reproduced(name: str) -> Reproduced:
    """A figure by its number, run and measured."""
    with tempfile.TemporaryDirectory() as folder:
        (one,) = reproduce(figures((name,)), Path(folder), "auto", lambda _: None)
        return one


def said(name: str) -> dict[str, str]:
    """What was measured of each phenomenon of a figure, every one of which must hold."""
    one = reproduced(name)
    missing = [f"{phenomenon.name}: {phenomenon.measured}" for phenomenon in one.result.phenomena if not phenomenon.holds]
    assert not missing, missing
    return {phenomenon.name: phenomenon.measured for phenomenon in one.result.phenomena}
