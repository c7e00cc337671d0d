"""A straight rod that is pulled and twisted too much does not stay straight: Greenhill 1883.

Source: Greenhill 1883, "On the strength of shafting when exposed both to torsion and to end thrust", Proceedings of the Institution of
Mechanical Engineers 34, 182-209; Timoshenko & Gere 1961, "Theory of elastic stability", 2nd ed., sec. 2.21.

Claim: a bow w = x + i y of the rod obeys EI w'''' - i M w''' - T w'' = 0, so that between clamps the matrix of its four solutions
(1, s, exp(i k s) twice, EI k^2 - M k + T = 0) with w and w' at both ends is singular. Without a pull that is at M = 8.987 EI / L (twice
the first root of tan x = x). There the margin of the straight rod vanishes, and the number of turns in the answer's sentence is that.
Twisted more, the answer is a refusal that names both numbers. Whole turns are kept or the answer is a refusal: link is twist plus
writhe, which is checked by the double integral of Gauss.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from loaded import answer, pose, straight
from posed import cable, frame, grasps
from scipy.optimize import brentq, minimize_scalar

from protocol.cable import Cable
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Problem
from shape_server.link import turns_borne, writhe

STRETCH = 100.0  # N
ALONG = frame((1.0, 0.0, 0.0))


def rod(weight: float = 0.0) -> Cable:
    return replace(cable(bending=0.1, twist=0.1, weight=weight), stretch=STRETCH)


def pulled(chord: float, roll: float = 0.0) -> Grasps:
    return grasps((0.0, (0.0, 0.0, 0.0), ALONG, Hold.CLAMP), (1.0, (chord, 0.0, 0.0), frame((1.0, 0.0, 0.0), roll), Hold.CLAMP))


def tension(chord: float) -> float:
    """T over EI / L^2, as many times as the rod is longer: m' = -r' x n, with r' of that length."""
    return STRETCH * (chord - 1.0) * chord / 0.1


def least(moment: float, pull: float) -> float:
    """Smallest singular value of the matrix of a bow between clamps, EI = L = 1."""
    waves = np.roots([1.0, -moment, pull]).astype(complex)
    rows = []
    for s in (0.0, 1.0):
        if pull == 0.0:  # one of the waves is then s^2
            wave = np.exp(1j * moment * s)
            rows += [[1, s, s**2, wave], [0, 1, 2 * s, 1j * moment * wave]]
        else:
            rows += [[1, s, *np.exp(1j * waves * s)], [0, 1, *(1j * waves * np.exp(1j * waves * s))]]
    return float(np.linalg.svd(np.array(rows), compute_uv=False)[-1])


def critical(pull: float) -> float:
    """Least moment at which the matrix is singular, EI = L = 1; beyond 2 sqrt(T) only, where both waves are real."""
    places = np.linspace(2 * np.sqrt(pull + 1.0), 2 * np.sqrt(pull + 40.0), 4000)
    sizes = np.array([least(place, pull) for place in places])
    first = next(k for k in range(1, 3999) if sizes[k] < min(sizes[k - 1], sizes[k + 1]) and sizes[k] < 1e-2)
    return float(minimize_scalar(lambda m: least(m, pull), bounds=(places[first - 1], places[first + 1]), method="bounded").x)


def test_without_a_pull_the_moment_is_twice_the_root_of_tangent() -> None:
    assert critical(0.0) == pytest.approx(2 * brentq(lambda x: np.tan(x) - x, 4.3, 4.6), rel=1e-6)


@pytest.mark.parametrize("chord", [1.001, 1.02, 1.1])
def test_the_number_of_turns_that_a_straight_rod_bears(chord: float) -> None:
    borne = turns_borne(Problem(cable=rod(), grasps=pulled(chord)))
    assert borne == pytest.approx(critical(tension(chord)) / (2 * np.pi), rel=1e-5)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("chord", [1.02, 1.1])
@pytest.mark.parametrize("part", [0.98, 0.995, 1.005, 1.02])
def test_a_rod_is_stable_up_to_that_number_of_turns(chord: float, part: float) -> None:
    """Twisted by its start, on 200 segments."""
    turns = part * critical(tension(chord)) / (2 * np.pi)
    start = straight(1.0, 200, ALONG, np.array([[-STRETCH * (chord - 1), 0.0, 0.0], [STRETCH * (chord - 1), 0.0, 0.0]]))
    rolled = np.array([frame((1.0, 0.0, 0.0), 2 * np.pi * turns * (k + 0.5) / 200) for k in range(200)])
    start = type(start)(s=start.s, frames=rolled, grasp_forces=start.grasp_forces)
    shape = answer(pose(rod(), pulled(chord, 2 * np.pi * turns), start=start), extrapolate=False)
    is_straight = (
        shape.outcome is Outcome.CONVERGED
        and float(np.abs(shape.nodes[:, 1:]).max()) < 1e-6
        and abs(shape.total_twist - 2 * np.pi * turns) < 1e-3
    )
    assert is_straight == (part < 1.0)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("turns", [4, 7, 10])
def test_more_turns_are_refused_with_both_numbers(turns: int, weight: float) -> None:
    shape = answer(pose(rod(weight), pulled(1.02), turns=(turns,)), tolerance=1e-3)
    assert shape.outcome is not Outcome.CONVERGED
    assert f"{turns} whole turns of twist were asked for" in shape.sentence
    said = re.search(r"bears (\S+) turns", shape.sentence)
    assert said is not None
    assert float(said[1]) == pytest.approx(critical(tension(1.02)) / (2 * np.pi), rel=5e-3)
    assert "ask for fewer" in shape.sentence


@pytest.mark.parametrize("stretch", [None, STRETCH])
@pytest.mark.parametrize("slack", [1e-6, 1e-3, 2e-2, 0.2])
@pytest.mark.parametrize("turns", [1, -1, 2, 4, 7])
def test_turns_are_kept_or_refused(turns: int, slack: float, stretch: float | None) -> None:
    """By the Gauss integral of the answer, closed far away: nearly straight from end to end, so that its writhe alone is left."""
    thin = cable(bending=0.1, twist=0.1, weight=1.0)
    thin = thin if stretch is None else rod(1.0)
    shape = answer(pose(thin, pulled(1.0 - slack), turns=(turns,)), tolerance=1e-3)
    if shape.outcome is not Outcome.CONVERGED:
        assert f"{turns} whole turns of twist were asked for" in shape.sentence
        return
    far = np.array([[-20.0, 0.0, 0.0]]), np.array([[20.0, 0.0, 0.0], [0.0, 30.0, 1.0]])
    link = shape.total_twist / (2 * np.pi) + gauss(np.vstack([far[0], shape.nodes, far[1]]))
    assert link == pytest.approx(turns, abs=0.1)


@pytest.mark.parametrize("turns", [1, 4, 10])
def test_a_descent_that_leads_nowhere_ends(turns: int) -> None:
    """A taut rod without weight: one that went on from a saddle to the same saddle took two million steps."""
    taut = grasps((0.0, (0.0, 0.0, 0.0), ALONG, Hold.CLAMP), (1.0, (1.0 - 1e-9, 0.0, 0.0), ALONG, Hold.CLAMP))
    shape = answer(pose(cable(bending=0.1, twist=0.1, weight=0.0), taut, turns=(turns,)), tolerance=1e-3)
    assert shape.iterations < 20_000  # measured 840 to 4100


def gauss(nodes: np.ndarray, parts: int = 6) -> float:
    """Writhe [turns] of a closed polygon by the double integral (r1 - r2) . t1 x t2 / 4 pi |r1 - r2|^3, by the middles of its parts."""
    edges = np.roll(nodes, -1, axis=0) - nodes
    share = (np.arange(parts) + 0.5) / parts
    places = (nodes[:, None] + share[:, None] * edges[:, None]).reshape(-1, 3)
    steps = np.repeat(edges / parts, parts, axis=0)
    away = places[:, None] - places[None]
    size = np.linalg.norm(away, axis=2)
    same = np.repeat(np.arange(len(nodes)), parts)
    size[same[:, None] == same[None]] = np.inf
    return float((np.einsum("ijk,ijk->ij", away, np.cross(steps[:, None], steps[None])) / size**3).sum() / (4 * np.pi))


@pytest.mark.thorough
@pytest.mark.parametrize("pitch", [0.1, 0.3, 1.0])
def test_the_writhe_of_a_polygon_is_the_integral_of_gauss(pitch: float) -> None:
    """A helix of two turns, closed by a wide detour; its mirror image has the opposite writhe, a plane curve none."""
    angle = np.linspace(0.0, 4 * np.pi, 60)
    helix = np.column_stack([np.cos(angle), np.sin(angle), pitch * angle / 2 / np.pi])
    out = np.linspace([1.0, 0.0, 2 * pitch], [8.0, 0.0, 2 * pitch], 80)[1:]
    closed = np.vstack([helix, out, out[::-1] * [1.0, 1.0, 0.0]])
    assert writhe(closed) == pytest.approx(gauss(closed, 12), abs=0.02)
    assert writhe(closed * [1.0, 1.0, -1.0]) == pytest.approx(-writhe(closed), abs=1e-12)
    assert abs(writhe(closed * [1.0, 0.3, 0.0])) < 1e-12
