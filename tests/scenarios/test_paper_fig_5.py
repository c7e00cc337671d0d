"""Fig. 5 of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said


@pytest.mark.slow
def test_an_obstacle_at_p_has_two_postures_and_history_decides() -> None:
    assert said("5")
