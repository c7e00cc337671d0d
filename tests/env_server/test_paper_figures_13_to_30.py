"""Figs. 13 to 30 of the paper: that their scenes show what they should, as phenomena, played in one process.

"Simulating robotic manipulation of cabling and interaction with surroundings", sections 5 and 6.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from played import measured, play

from scenarios.paper.recorded import open_take
from scenarios.paper.reproduce import figures, reproduce

BY_MODULE = figures(("13", "14", "15", "16", "18", "28"))
SLOW = ("fig_13_self", "fig_17_lost", "fig_18_case_study", "fig_28_harness")


@pytest.mark.parametrize("module", [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in BY_MODULE])
def test_every_phenomenon_of_a_figure_is_there(module: str) -> None:
    result = measured(BY_MODULE[module])
    assert [f"{one.name}: {one.measured}" for one in result.phenomena if not one.holds] == []
    assert result.panels
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
    times = [frame.time for frame in frames]
    assert times == sorted(times)
    assert all(frame.shapes[0].error is None for frame in frames if frame.relaxation)
    assert all(frame.shapes[0].error is not None for frame in frames if not frame.relaxation)
    late = frames[-1].time - 1.0  # s, by which the motion holds up the path
    assert 0.05 < late < 0.2
    assert frames[-1].picture == "snapped"


@pytest.mark.slow
def test_three_programs_record_the_motion_of_a_cable_that_loses_its_peg(tmp_path: Path) -> None:
    chosen = figures(("17",))
    (done,) = reproduce(chosen, tmp_path, "compiled", lambda _: None)
    assert done.holds, [one for one in done.result.phenomena if not one.holds]
    recorded = open_take("lost", tmp_path / "takes" / "fig_17_lost-lost")
    assert sum(bool(frame.relaxation) for frame in recorded.frames) == 19
