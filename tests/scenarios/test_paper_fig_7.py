"""Fig. 7 of the paper, through the three real programs."""

from __future__ import annotations

import pytest
from taken import said


@pytest.mark.slow
def test_the_way_of_the_right_gripper_decides_whether_contact_is_kept() -> None:
    assert said("7")
