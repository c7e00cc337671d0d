"""The choice of effects while a scene runs: models hand over with a bounded jump, nothing flickers, and forcing is obeyed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from in_process import steps

from protocol.effects import EffectChoice
from protocol.kinds import Outcome
from protocol.messages import Shape
from protocol.scene import Cable, Gripper, Move, Scene, Target

LENGTH = 1.0
CABLE = Cable(name="c", length=LENGTH, diameter=0.006, mass_per_length=0.1, bending=1.8e-6, twist=1.8e-6, stretch=2e5)


def scene(effects: EffectChoice = "auto") -> Scene:
    """A soft cable whose clamps are drawn apart, from a slack shape to a nearly taut one, and back.

    Its boundary layers shrink as the tension grows, and so does the slack on which they tell.
    """
    grippers = (
        Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.0, 1.0), tangent=(1.0, 0.0, -1.0), approach=(-1.0, 0.0, -1.0)),
        Gripper(name="right", cable="c", at=LENGTH, position=(0.5, 0.0, 1.0), tangent=(1.0, 0.0, 1.0), approach=(1.0, 0.0, -1.0)),
    )
    moves = tuple(
        Move(name=name, duration=0.6, targets=(Target(gripper="right", by=(way, 0.0, 0.0)),))
        for name, way in (("out", 0.45), ("in", -0.45))
    )
    return Scene(title="t", cables=(CABLE,), grippers=grippers, moves=moves, time_step=0.03, tolerance=4e-3, effects=effects)


def shapes_of(run: Scene) -> list[Shape]:
    return [stepped.cables[0].shape for _, stepped in steps(run)]


def test_models_hand_over_while_running_and_every_step_is_the_rod_within_its_error() -> None:
    auto, rod = shapes_of(scene()), shapes_of(replace(scene(("gravity", "bending", "twist", "stretch")), tolerance=4e-4))
    assert all(shape.outcome is Outcome.CONVERGED for shape in (*auto, *rod))
    assert {shape.model for shape in rod} == {"rod"}
    models = [shape.model for shape in auto]
    assert set(models) == {"rod", "catenary"}
    changes = sum(one != other for one, other in pairwise(models))
    assert changes <= 2  # no flicker
    for shape, exact in zip(auto, rod, strict=True):
        at = np.column_stack([np.interp(shape.s, exact.s, column) for column in exact.nodes.T])
        assert shape.error is not None
        assert exact.error is not None
        assert shape.error <= 4e-3
        assert np.linalg.norm(shape.nodes - at, axis=1).max() <= shape.error + exact.error + 1e-4  # chords of the reference


def test_forcing_off_what_matters_warns_in_every_step() -> None:
    for shape in shapes_of(scene({"bending": False})):
        assert shape.model == "catenary"
        if shape.left_out["bending"] > 4e-4:
            assert "'bending' was left out as asked" in shape.sentence


def test_forced_effects_stay_on() -> None:
    assert all({"bending", "stretch"} <= set(shape.effects) for shape in shapes_of(scene({"bending": True, "stretch": True})))
