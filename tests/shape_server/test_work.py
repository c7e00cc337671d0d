"""Accuracy and work against the committed baseline: neither may be worse by more than a tenth.

True errors, factorisations, nodes and bytes of a reply do not depend on the machine, so they are compared with `work.json` in every run of
the tests. Less work and smaller errors pass; times are never compared. The baseline is renewed on purpose, and its change explained, by

    python tests/shape_server/test_work.py
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest
from rods import GRAVITY, cable, contacts, random_spans, span, start_from
from rods import Row as ContactRow

from protocol.codec import encode
from protocol.messages import Problem, Shape, ShapeReply
from shape_server import kernels, solve
from shape_server.accuracy.draws import true_error
from shape_server.accuracy.problems import standard

BASELINE = Path(__file__).parent / "work.json"
WORSE = 1.1
ROUNDING = 1e-9  # of the length; errors below it may grow
SOLVED = ("slack", "twisted", "flat and bent", "stretching", "no bending")  # of the standard set, quick to find a reference for
TOLERANCES = (1e-3, 1e-5, 1e-7)  # of the length


@cache
def errors() -> dict[str, dict[str, float]]:
    """True errors over the length, and the work they took, of problems with a reference of other making."""
    problems, out = {one.name: one for one in standard()}, {}
    for name in SOLVED:
        static, length = problems[name], problems[name].problem.cable.length
        shapes = [solve(static.problem, static.gravity, tolerance=tolerance * length, path=kernels) for tolerance in TOLERANCES]
        exact = static.exact(shapes[-1])
        assert exact is not None
        for tolerance, shape in zip(TOLERANCES, shapes, strict=True):
            out[f"{name} to {tolerance:g} L"] = {"true error": true_error(shape, exact) / length, **_counts(shape)}
    return out


@cache
def work() -> dict[str, dict[str, float]]:
    """Work of problems that touch, that start warm, that are soft or random."""
    hanging = Problem(cable=cable(), grasps=span())
    edge = ContactRow(s=0.5, point=(0.45, 0.0, -0.1))
    asks: dict[str, tuple[Problem, float]] = {
        "cold to 1e-3 m": (hanging, 1e-3),
        "cold to 1e-6 m": (hanging, 1e-6),
        "cold to 1e-9 m": (hanging, 1e-9),
        "cold, soft": (Problem(cable=cable(bending=1e-4), grasps=span()), 1e-3),
        "cold, on a face": (Problem(cable=cable(), grasps=span(0.9), contacts=contacts(edge)), 1e-3),
    }
    shapes = {name: solve(problem, GRAVITY, tolerance=tolerance, path=kernels) for name, (problem, tolerance) in asks.items()}
    warm = Problem(cable=cable(), grasps=span(0.61), start=start_from(shapes["cold to 1e-3 m"]))
    shapes["warm, 1 cm on"] = solve(warm, GRAVITY, path=kernels)
    spans = [solve(problem, GRAVITY, path=kernels) for problem in random_spans(50, 1e-3, seed=12)]
    return {name: _counts(shape) for name, shape in shapes.items()} | {
        "50 random spans, cold": {"factorisations": float(sum(shape.cost.factorisations for shape in spans))}
    }


def _counts(shape: Shape) -> dict[str, float]:
    return {
        "factorisations": float(shape.cost.factorisations),
        "nodes": float(len(shape.s)),
        "bytes of a reply": float(len(encode(ShapeReply(session="", step=0, round=0, shapes=(shape,), busy=0.0)))),
    }


def _expected() -> dict[str, dict[str, float]]:
    known: dict[str, dict[str, float]] = json.loads(BASELINE.read_text(encoding="utf-8"))
    return known


@pytest.mark.thorough
@pytest.mark.parametrize("name", _expected() if BASELINE.is_file() else ())
def test_neither_error_nor_work_is_worse_than_in_the_baseline(name: str) -> None:
    found = (errors() | work())[name]
    for what, value in _expected()[name].items():
        floor = ROUNDING if what == "true error" else 0.0
        assert found[what] <= WORSE * max(value, floor), f"{what} of {name}"


def test_the_baseline_holds_all_that_is_measured() -> None:
    assert _expected().keys() == (errors() | work()).keys()


if __name__ == "__main__":
    everything = errors() | work()
    measured = {name: {what: round(value, 12) for what, value in one.items()} for name, one in everything.items()}
    BASELINE.write_text(json.dumps(measured, indent=2) + "\n", encoding="utf-8")
