"""Summaries of recordings with known figures."""

from __future__ import annotations

import io
import json
from pathlib import Path

import msgspec
import pytest
from recordings import frame, record, shape
from rich.console import Console

from protocol.kinds import Outcome
from protocol.messages import Finished, Predicted, Shape
from scenarios import summary

END = Finished(session="test", frames=4, failed=False, sentence="every move is done")


def test_a_summary_holds_the_extremes_of_the_run(tmp_path: Path) -> None:
    frames = [
        frame(0, seconds=5.0, penetration=1e-9),
        frame(1, seconds=0.002, contacts=3, grasp_error=2e-8),
        frame(2, seconds=0.004, shapes=(shape(tension=7.0, curvature=20.0, force=5.0),), rounds=4, collisions=(("a", "b"),)),
        frame(3, seconds=9.0, shapes=(shape(outcome=Outcome.NOT_CONVERGED, tension=1e6, curvature=1e6, force=1e6),), penetration=2e-6),
    ]
    found = summary.summarise(record(tmp_path / "r", frames, finished=END), wall=12.5)

    assert found["steps"] == found["steps_planned"] == 3
    assert found["complete"]
    assert found["steps_per_second"] == pytest.approx(3 / 9.006)  # hard steps count in full, the start posture does not
    assert found["bill_ms"] == pytest.approx({"solve": 4.0, "search": 0, "robot": 0, "encode": 0, "wire": 0, "wait": 0, "total": 4.0})
    assert found["wall_s"] == 12.5
    assert (found["worst_penetration_m"], found["worst_grasp_error_m"], found["worst_error_estimate_m"]) == (2e-6, 2e-8, 1e-4)
    assert found["outcomes"] == {"converged": 3, "not_converged": 1}
    assert (found["contacts_max"], found["rounds_max"], found["collisions"]) == (3, 4, 1)
    assert (found["tension_max_N"], found["bend_radius_min_m"], found["grasp_force_max_N"]) == (7.0, 0.05, 5.0)
    assert found["versions"] == {"python": "3"}


def test_what_one_more_round_would_change_is_part_of_the_error(tmp_path: Path) -> None:
    frames = [frame(0), frame(1, coupling=(3e-4,)), frame(2, coupling=(1e-9,))]
    found = summary.summarise(record(tmp_path / "r", frames, finished=END))
    assert found["worst_coupling_m"] == 3e-4
    assert found["worst_error_estimate_m"] == pytest.approx(1e-4 + 3e-4)


def test_what_a_recording_cannot_say_is_null(tmp_path: Path) -> None:
    found = summary.summarise(record(tmp_path / "r", []))

    assert found["steps"] == 0
    assert not found["complete"]
    nulls = {key for key, value in found.items() if value is None}
    assert nulls == {
        "wall_s",
        "steps_per_second",
        "worst_penetration_m",
        "worst_grasp_error_m",
        "worst_error_estimate_m",
        "worst_coupling_m",
        "tension_max_N",
        "bend_radius_min_m",
        "grasp_force_max_N",
        "torque_ratio_max",
    }


def test_a_straight_cable_has_no_bend_radius(tmp_path: Path) -> None:
    found = summary.summarise(record(tmp_path / "r", [frame(0, shapes=(shape(curvature=0.0),))]))

    assert found["bend_radius_min_m"] is None


def test_a_run_that_broke_off_says_so_in_json_and_table(tmp_path: Path) -> None:
    found = summary.summarise(record(tmp_path / "r", [frame(0), frame(1)], steps=300))
    summary.write(tmp_path, found)

    assert json.loads((tmp_path / "summary.json").read_text()) == found
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r", "summary.json"]
    assert "1 of 300  the recording breaks off" in shown(found)


def test_the_table_shows_units_and_warns_of_what_did_not_converge(tmp_path: Path) -> None:
    frames = [frame(0), frame(1, shapes=(shape(outcome=Outcome.UNSTABLE),), penetration=3e-6, collisions=(("a", "b"),))]
    text = shown(summary.summarise(record(tmp_path / "r", frames, finished=END), wall=1.0))

    for part in ("a scene [0] of a test", "3 um", "500 mm at least", "1 N at most", "not all converged", "in 1 steps", "1000 steps/s"):
        assert part in text


def shown(found: summary.Summary) -> str:
    console = Console(width=200, force_terminal=False)
    with console.capture() as capture:
        console.print(summary.table(found))
    return capture.get()


def test_frames_between_two_equilibria_count_as_such_and_nowhere_else(tmp_path: Path) -> None:
    frames = [frame(0), msgspec.structs.replace(frame(1, penetration=1.0), relaxation=0.5), frame(2)]
    found = summary.summarise(record(tmp_path / "r", frames))
    assert (found["steps"], found["frames_between_equilibria"]) == (1, 1)
    assert found["worst_penetration_m"] < 1.0
    console = Console(width=100)
    with console.capture() as shown:
        console.print(summary.table(found))
    assert "artificial motion, in 1 frame" in shown.get()


def test_the_summary_says_when_effects_were_on_and_what_those_left_out_could_have_changed(tmp_path: Path) -> None:
    def with_choice(*, is_on: bool, why: str, size: float) -> Shape:
        one = Predicted(name="stretch", size=size, force=1.0, curvature=0.1, is_on=is_on, why=why)
        return msgspec.structs.replace(shape(), predicted=(one,))

    frames = [
        frame(0, shapes=(with_choice(is_on=True, why="above", size=5e-4),)),
        frame(1, shapes=(with_choice(is_on=False, why="below", size=2e-5),)),
        frame(2, shapes=(with_choice(is_on=False, why="below", size=3e-5),)),
        frame(3, shapes=(with_choice(is_on=False, why="asked", size=0.7),)),
    ]
    found = summary.summarise(record(tmp_path / "r", frames, finished=END))
    (one,) = found["effects"]
    assert (one["effect"], [stretch["why"] for stretch in one["stretches"]]) == ("stretch", ["above", "below", "asked"])
    assert one["stretches"][1]["size_m"] == 3e-5
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(summary.table(found))
    assert "'stretch'" in (text := console.export_text())
    assert "as asked" in text
