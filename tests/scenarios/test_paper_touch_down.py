"""The touch-down experiment of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said


@pytest.mark.slow
def test_a_mark_on_the_cable_tells_three_kinds_of_contact_apart() -> None:
    assert said("touch_down")
