"""Figs. 13 to 30 of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said

MOTION = "way of each of 18 points over time"


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["13", "14", "15", "18", "28"])
def test_every_phenomenon_of_a_figure_is_there(figure: str) -> None:
    assert said(figure)


@pytest.mark.slow
def test_figs_16_and_17_a_cable_that_loses_its_peg_goes_smoothly_to_rest_within_a_second() -> None:
    found = said("17")
    assert found["duration"] == "1.000 s, 19 frames between the two equilibria"
    assert found["the peg is drawn out"].startswith("1 contact, then 0")
    assert MOTION in found
