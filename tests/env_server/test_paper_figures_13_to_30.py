"""Figs. 13 to 30 of the paper, as far as their scenes are quick enough to be played in one process with every run of the tests.

All of them, through the three programs, are in `tests/scenarios/test_paper_figs_13_to_30.py`.
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from played import measured, play

from scenarios.paper.reproduce import figures

QUICK = figures(("14", "15"))


@pytest.mark.parametrize("module", list(QUICK))
def test_every_phenomenon_of_a_figure_is_there(module: str) -> None:
    result = measured(QUICK[module])
    assert [f"{one.name}: {one.measured}" for one in result.phenomena if not one.holds] == []
    for panel in result.panels:
        assert panel.x_label.endswith("]")
        assert panel.y_label.endswith("]")
        assert panel.caption.endswith(".")


def test_an_arch_that_snaps_is_shown_on_its_way_and_goes_on() -> None:
    """The frames between count up in time and sequence, are marked, and are followed by the equilibrium and the rest of the path."""
    arch = play("paper/fig_17_arch")
    frames = list(arch.frames)
    shown = [index for index, frame in enumerate(frames) if frame.relaxation]
    assert arch.is_finished
    assert shown == list(range(shown[0], shown[-1] + 1))
    assert 1 <= len(shown) <= 4  # a pendulum of 0.1 m is back after 0.15 s
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert all(after.time > before.time for before, after in pairwise(frames))
    assert all(frame.shapes[0].error is None for frame in frames if frame.relaxation)
    assert all(frame.shapes[0].error is not None for frame in frames if not frame.relaxation)
    late = frames[-1].time - 1.0  # s, by which the motion holds up the path
    assert 0.05 < late < 0.2
    assert frames[-1].picture == "snapped"
