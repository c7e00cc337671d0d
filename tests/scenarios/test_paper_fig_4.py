"""Fig. 4 of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said


@pytest.mark.slow
def test_drawn_over_the_ground_ends_differently_for_each_kind_of_friction() -> None:
    assert said("4")
