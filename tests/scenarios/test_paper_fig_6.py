"""Fig. 6 of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said


@pytest.mark.slow
def test_a_bond_gives_way_until_both_parts_are_straight_and_one_step_further_is_refused() -> None:
    assert said("6")
