"""Runs of one scene are compared at equal arc lengths and equal times."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "viz_client"))

from synthetic import frame

import scenarios
from scenarios import scene_study
from scenarios.scene_study import EFFECT, TIME_STEP, Taken, _settings, apart, usual


def test_runs_are_compared_where_both_have_a_time_and_at_equal_arc_lengths() -> None:
    exact = {0.1 * number: frame(number) for number in range(5)}
    moved = msgspec.structs.replace(exact[0.2].shapes[0], nodes=exact[0.2].shapes[0].nodes + np.array([0.0, 0.0, 3e-3]))
    run = {0.0: exact[0.0], 0.2: msgspec.structs.replace(exact[0.2], shapes=(moved,))}
    assert apart(run, exact) == pytest.approx([0.0, 3e-3])
    assert apart(exact, exact) == [0.0] * 5


def test_a_time_that_only_one_run_has_is_left_out() -> None:
    exact = {0.1 * number: frame(number) for number in range(3)}
    assert apart({0.05: frame(40)}, exact) == []


def test_the_usual_error_leaves_out_one_time_of_twenty() -> None:
    assert usual([*([1.0] * 19), 7.0]) == 7.0
    assert usual([*([1.0] * 39), 7.0]) == 1.0


def test_an_effect_is_left_out_where_a_cable_has_the_number_that_asks_for_it() -> None:
    scene = scenarios.load("harness_assembly", ("cable.stretch=1e4",))
    settings = {setting: changed for group, setting, changed in _settings(scene) if group == EFFECT}
    assert list(settings) == ["without stretch"]
    assert settings["without stretch"].cables[0].stretch is None


def test_a_run_that_ends_before_its_time_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenarios.load("harness_assembly")
    frames = {0.1 * number: msgspec.structs.replace(frame(number), coupling=(0.0,) * len(frame(number).shapes)) for number in range(3)}

    def run(asked: object, _name: str, _show: object) -> Taken:
        is_long = getattr(asked, "time_step", 0.0) > 3.0 * scene.time_step
        return Taken(frames, 1.0, "the cable is too short" if is_long else "")

    monkeypatch.setattr(scene_study, "_run", run)
    found = scene_study.study_scene(scene, "harness", None, lambda _: None)  # type: ignore[arg-type]
    left_out = [remark for remark in found["remarks"] if "too short" in remark]
    assert len(left_out) == 1
    assert left_out[0].startswith(f"{TIME_STEP} {4 * scene.time_step:g} s: left out")
    assert len(found["rows"]) == len(list(_settings(scene))) - 1
