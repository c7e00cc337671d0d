"""Which model answers: the one named, or the cheapest that keeps the tolerance; what it leaves out is said in metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, KERNELS, WEIGHTLESS, cable, contacts, grasps, is_honest, span, start_from
from rods import Row as ContactRow

from protocol.kinds import Hold, Model, Outcome
from protocol.messages import PointLoads, Problem, Shape
from protocol.scene import Cable, LumpedMass, Section
from shape_server import solve

SOFT, MICRO = cable(bending=1e-8), replace(cable(bending=1e-3), micro_length=0.02)


def asked(rod: Cable, model: Model = Model.AUTO, *, chord: float = 0.6, tolerance: float = 1e-3) -> Shape:
    problem = Problem(cable=rod, grasps=span(chord), model=model)
    return solve(problem, GRAVITY, tolerance=tolerance, path=KERNELS)


def apart(one: Shape, other: Shape) -> float:
    """Largest distance [m] of the nodes of one shape from the other."""
    at = np.column_stack([np.interp(one.s, other.s, column) for column in other.nodes.T])
    return float(np.linalg.norm(one.nodes - at, axis=1).max())


@pytest.mark.parametrize(
    ("rod", "chord", "tolerance", "model"),
    [
        (cable(), 1 - 1e-9, 1e-3, "taut"),
        (cable(), 1 - 1e-9, 1e-5, "rod"),
        (SOFT, 0.6, 1e-3, "catenary"),
        (SOFT, 0.6, 1e-4, "rod"),
        (cable(), 0.6, 1e-3, "rod"),
        (cable(bending=None), 0.6, 1e-3, "catenary"),
        (MICRO, 0.99, 1e-3, "gradient"),
        (MICRO, 0.97, 1e-3, "rod"),
        (MICRO, 0.6, 1e-3, "rod"),
    ],
)
def test_the_cheapest_model_that_keeps_the_tolerance_is_taken(rod: Cable, chord: float, tolerance: float, model: str) -> None:
    shape = asked(rod, chord=chord, tolerance=tolerance)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.model == model
    assert is_honest(shape)


@pytest.mark.parametrize(
    ("rod", "model", "chord"),
    [
        (cable(bending=1e-3), Model.GRADIENT, 0.97),
        (SOFT, Model.CATENARY, 0.6),
        (cable(bending=1e-4), Model.CATENARY, 0.6),
        (MICRO, Model.GRADIENT, 0.97),
        (replace(cable(bending=1e-4), micro_length=0.05), Model.CATENARY, 0.6),
        (cable(), Model.TAUT, 0.9),
    ],
)
def test_what_a_cheaper_model_leaves_out_is_no_more_than_it_says(rod: Cable, model: Model, chord: float) -> None:
    cheap, exact = asked(rod, model, chord=chord), asked(rod, Model.ROD, chord=chord, tolerance=1e-5)
    assert cheap.model == model.value
    assert cheap.error is not None
    assert apart(exact, cheap) <= cheap.error  # measured 0.29 (gradient), 0.76 and 0.93 (catenary), 0.97 (taut) of it
    if model is not Model.GRADIENT:
        assert set(cheap.left_out) == {"bending"}
        assert not {"bending", "micro_length"} & set(cheap.effects)


def test_the_gradient_cable_gives_the_forces_and_moments_of_the_rod() -> None:
    cheap, exact = asked(cable(bending=1e-3), Model.GRADIENT, chord=0.97), asked(cable(bending=1e-3), Model.ROD, chord=0.97, tolerance=1e-6)
    np.testing.assert_allclose(cheap.grasp_wrenches[:, :3], exact.grasp_wrenches[:, :3], atol=0.02)  # N; measured 0.006
    np.testing.assert_allclose(cheap.grasp_wrenches[:, 3:], exact.grasp_wrenches[:, 3:], atol=1e-3)  # N m; measured 3.4e-4 of 0.0144
    assert cheap.energy == pytest.approx(exact.energy, abs=1e-3)  # J; measured 5e-4


@pytest.mark.parametrize("model", [Model.TAUT, Model.GRADIENT, Model.CATENARY])
def test_a_model_that_does_not_cover_the_problem_says_so(model: Model) -> None:
    held = grasps((0.0, (0, 0, 0), ALONG_X), (0.5, (0.3, 0, 0), ALONG_X), (1.0, (0.6, 0, 0), ALONG_X))
    loads = PointLoads(s=np.array([0.2]), force=np.ones((1, 3)))
    shape = solve(Problem(cable=cable(bending=1e-3), grasps=held, loads=loads, model=model), GRAVITY, path=KERNELS)
    assert shape.outcome is Outcome.UNSUPPORTED
    assert len(shape.s) == 0


@pytest.mark.parametrize(
    "changes",
    [{"masses": (LumpedMass(0.5, 0.1),)}, {"sections": (Section(0.2, 0.4, mass_per_length=1.0),)}],
    ids=["masses", "sections"],
)
def test_a_catenary_never_leaves_out_what_hangs_on_it(changes: dict[str, object]) -> None:
    shape = solve(Problem(cable=replace(cable(bending=None), **changes), grasps=span()), GRAVITY)
    assert shape.outcome is Outcome.UNSUPPORTED
    assert f"'{next(iter(changes))}'" in shape.sentence


def test_a_rod_without_bending_is_refused() -> None:
    assert "needs 'bending'" in asked(cable(bending=None), Model.ROD).sentence


def test_contacts_start_shapes_and_whole_turns_keep_the_rod() -> None:
    near = solve(Problem(cable=MICRO, grasps=span(0.99)), GRAVITY, path=KERNELS)
    assert near.model == "gradient"
    assert solve(Problem(cable=MICRO, grasps=span(0.99), start=start_from(near)), GRAVITY, path=KERNELS).model == "rod"
    shape = solve(Problem(cable=SOFT, grasps=span(), model=Model.ROD), GRAVITY, path=KERNELS)
    for more in (
        {"start": start_from(shape)},
        {"contacts": contacts(ContactRow(s=0.5, point=(0.3, 0.0, -1.0)))},
        {"turns": (1,)},
    ):
        assert solve(Problem(cable=SOFT, grasps=span(), **more), GRAVITY, path=KERNELS).model == "rod"


@pytest.mark.parametrize("stretch", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("chord", [0.5, 0.99, 1.0, 1.2])
def test_a_soft_rod_that_stretches_hangs_as_the_elastic_catenary(stretch: float, chord: float) -> None:
    rod = solve(Problem(cable=replace(cable(bending=1e-6), stretch=stretch), grasps=span(chord)), GRAVITY, tolerance=1e-4, path=KERNELS)
    exact = solve(Problem(cable=replace(cable(bending=None), stretch=stretch), grasps=span(chord)), GRAVITY, tolerance=1e-5)
    assert rod.outcome is exact.outcome is Outcome.CONVERGED
    layer = 1.3 * np.sqrt(1e-6 / np.linalg.norm(exact.grasp_wrenches[0, :3]))
    assert apart(rod, exact) < layer + 1e-4
    assert rod.tension.max() == pytest.approx(exact.tension.max(), rel=0.02)


def test_a_hinged_cable_without_weight_is_a_rod() -> None:
    shape = solve(Problem(cable=SOFT, grasps=span(0.6, hold=Hold.HINGE)), WEIGHTLESS, path=KERNELS)
    assert shape.model == "rod"
