"""A cable that passes an edge a second time: the answer says where, and how much too near; distances against brute force."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from rods import KERNELS, Row, contacts

from protocol.kinds import Feature
from protocol.messages import Problem, Shape
from shape_server.hard_cases import touching
from shape_server.trespass import trespass


@pytest.mark.slow
def test_the_distance_is_that_of_many_points_on_cable_and_edge() -> None:
    rng, s = np.random.default_rng(4), np.linspace(0.0, 1.0, 31)
    share = np.linspace(0.0, 1.0, 401)
    found = 0
    for _ in range(30):
        nodes = np.cumsum(rng.normal(size=(31, 3)) / 31 / np.sqrt(3), axis=0)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        point = nodes[15] + rng.normal(scale=0.02, size=3)
        row = Row(s=0.5, point=point, direction=direction, feature=Feature.EDGE, extent=(-0.05, 0.08), distance=0.03)
        deep, place, contact = trespass(contacts(row), s, nodes)
        curve = np.column_stack([np.interp(np.linspace(0, 1, 12001), s, column) for column in nodes.T])
        edge = point + np.outer(-0.05 + 0.13 * share, direction)
        nearest = np.sqrt(((curve[:, None] - edge[None]) ** 2).sum(axis=2)).min()
        assert deep == pytest.approx(max(0.03 - nearest, 0.0), abs=3e-4)  # the points are 1e-4 m apart
        found += contact == 0
        if contact == 0:
            assert 0.0 <= place <= 1.0
    assert found > 10


@pytest.mark.parametrize("seed", touching.PASSING)
def test_an_answer_says_where_the_other_leg_passes_an_edge(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random edges of the catalogue, of which the cable passes one a second time, 0.98 to 1.94 mm too near."""
    answers: list[tuple[Problem, Shape]] = []
    ask = touching._touched

    def kept(path: ModuleType, *rows: Row) -> tuple[Problem, Shape]:
        answers.append(ask(path, *rows))
        return answers[-1]

    monkeypatch.setattr(touching, "_touched", kept)
    list(touching._random_rows(seed, KERNELS))
    ((problem, shape),) = answers
    assert problem.contacts is not None
    deep, place, contact = trespass(problem.contacts, shape.s, shape.nodes)
    assert 9e-4 < deep < 2e-3
    assert abs(place - problem.contacts.s[contact]) > 0.1
    assert f"at s = {place:.4g} m the cable comes {deep:.2g} m too near to what contact {contact} touches" in shape.sentence
    assert shape.error is not None
    assert shape.error > deep
