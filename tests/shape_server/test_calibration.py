"""Numbers fitted to points of shapes that were computed with known numbers and disturbed by noise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from protocol.cable import Cable, Section
from protocol.errors import CablecosimError
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Problem
from shape_server import kernels, solve
from shape_server.calibration import Measured, calibrate, read_points
from shape_server.calibration.report import as_json, table

GRAVITY = (0.0, 0.0, -9.81)
SPACE = np.ones(3, dtype=bool)
IN_PLANE = np.array([True, False, True])


def _cable(bending: float, twist: float, **more: object) -> Cable:
    return Cable(name="wire", length=1.0, diameter=0.006, mass_per_length=0.05, bending=bending, twist=twist, **more)  # type: ignore[arg-type]


def _problem(cable: Cable, *, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0, end: tuple[float, ...] = (0.6, 0.0, 0.1)) -> Problem:
    first = Rotation.from_euler("y", 90, degrees=True)
    last = Rotation.from_euler("zy", [yaw, pitch]) * first * Rotation.from_euler("z", roll)
    grasps = Grasps(
        s=np.array([0.0, 1.0]),
        position=np.array([[0.0, 0.0, 0.0], end]),
        quaternion=np.array([first.as_quat(), last.as_quat()]),
        hold=(Hold.CLAMP, Hold.CLAMP),
    )
    return Problem(cable=cable, grasps=grasps)


def _points(problem: Problem, count: int, noise: float, rng: np.random.Generator) -> np.ndarray:
    shape = solve(problem, GRAVITY, tolerance=1e-6, path=kernels)
    assert shape.outcome is Outcome.CONVERGED
    points: np.ndarray = CubicSpline(shape.s, shape.nodes)(np.sort(rng.uniform(0.02, 0.98, count)))
    return points + noise * rng.normal(size=points.shape)


def _share_inside(cases: int) -> dict[str, float]:
    """Share of random cases whose interval holds the true number, among those that were fitted."""
    rng = np.random.default_rng(12)
    inside: dict[str, list[bool]] = {"bending": [], "twist": []}
    for _ in range(cases):
        truth = {"bending": 10 ** rng.uniform(-3.3, -1.5), "twist": 10 ** rng.uniform(-3.0, -1.5)}
        pose = {"yaw": rng.uniform(-1, 1), "pitch": rng.uniform(-1, 1), "roll": rng.uniform(-2.5, 2.5)}
        end = (rng.uniform(0.4, 0.8), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2))
        noise, count = 10 ** rng.uniform(-4, -3), int(rng.integers(15, 60))
        points = _points(_problem(_cable(**truth), end=end, **pose), count, noise, rng)
        guess = _cable(truth["bending"] * 10 ** rng.uniform(-0.7, 0.7), truth["twist"] * 10 ** rng.uniform(-0.4, 0.4))
        names = ("bending", "twist")
        found = calibrate(_problem(guess, end=end, **pose), GRAVITY, Measured(points, SPACE), names, path=kernels)
        for name, one in found.intervals.items():
            inside[name].append(one.low <= truth[name] <= one.high)
    return {name: float(np.mean(held)) for name, held in inside.items()}


@pytest.mark.slow
def test_intervals_hold_the_true_stiffness() -> None:
    assert min(_share_inside(3).values()) >= 0.6


@pytest.mark.slow
def test_intervals_hold_the_true_stiffness_in_nine_of_ten_of_two_hundred_cases() -> None:
    assert min(_share_inside(200).values()) >= 0.9


def test_points_of_a_plane_shape_tell_nothing_of_twist() -> None:
    problem, rng = _problem(_cable(4e-3, 5e-3)), np.random.default_rng(1)
    points = _points(problem, 30, 2e-4, rng)
    found = calibrate(problem, GRAVITY, Measured(points, SPACE), path=kernels)
    assert found.intervals.keys() == {"bending"}
    assert "not at all" in found.left["twist"] or "factor" in found.left["twist"]
    assert found.intervals["bending"].low < 4e-3 < found.intervals["bending"].high
    assert found.sigma == pytest.approx(2e-4, rel=0.3)


def test_points_measured_in_a_plane_count_once() -> None:
    problem, rng = _problem(_cable(4e-3, 5e-3)), np.random.default_rng(2)
    points = _points(problem, 60, 2e-4, rng) * IN_PLANE
    found = calibrate(problem, GRAVITY, Measured(points, IN_PLANE), ("bending",), path=kernels)
    assert found.intervals["bending"].low < 4e-3 < found.intervals["bending"].high
    assert found.sigma == pytest.approx(2e-4, rel=0.3)


@pytest.mark.thorough
def test_a_micro_structure_length_is_found_where_there_is_one() -> None:
    rng = np.random.default_rng(3)
    points = _points(_problem(_cable(4e-3, 5e-3, micro_length=0.08)), 60, 5e-5, rng)
    found = calibrate(_problem(_cable(6e-3, 5e-3)), GRAVITY, Measured(points, SPACE), path=kernels)
    assert found.intervals["micro_length"].low < 0.08 < found.intervals["micro_length"].high
    assert found.intervals["bending"].low < 4e-3 < found.intervals["bending"].high


def test_a_micro_structure_length_is_not_invented() -> None:
    points = _points(_problem(_cable(4e-3, 5e-3)), 40, 1e-4, np.random.default_rng(4))
    found = calibrate(_problem(_cable(6e-3, 5e-3)), GRAVITY, Measured(points, SPACE), path=kernels)
    assert "chance" in found.left["micro_length"]


def test_the_weight_is_told_where_the_stiffness_is_known() -> None:
    rng = np.random.default_rng(5)
    points = _points(_problem(_cable(4e-3, 5e-3)), 40, 1e-4, rng)
    guess = Cable(name="wire", length=1.0, diameter=0.006, mass_per_length=0.02, bending=4e-3, twist=5e-3)
    found = calibrate(_problem(guess), GRAVITY, Measured(points, SPACE), ("mass_per_length",), path=kernels)
    assert found.intervals["mass_per_length"].low < 0.05 < found.intervals["mass_per_length"].high


def test_ratios_alone_are_refused() -> None:
    problem = _problem(_cable(4e-3, 5e-3))
    points = _points(problem, 40, 1e-4, np.random.default_rng(6))
    with pytest.raises(CablecosimError, match="the shape tells only the ratios of bending, twist, mass_per_length"):
        calibrate(problem, GRAVITY, Measured(points, SPACE), ("bending", "twist", "mass_per_length"), path=kernels)


def test_a_stiffness_and_the_weight_of_a_plane_shape_are_one_number() -> None:
    problem = _problem(_cable(4e-3, 5e-3))
    points = _points(problem, 40, 1e-4, np.random.default_rng(7))
    with pytest.raises(CablecosimError, match="bending and mass_per_length apart; take one of them as known"):
        calibrate(problem, GRAVITY, Measured(points, SPACE), ("bending", "mass_per_length"), path=kernels)


def test_a_taped_part_keeps_its_ratio() -> None:
    rng = np.random.default_rng(8)

    def cable(factor: float) -> Cable:
        return _cable(4e-3 * factor, 5e-3, sections=(Section(start=0.3, end=0.6, bending=1.2e-2 * factor),))

    points = _points(_problem(cable(1.0)), 60, 1e-4, rng)
    found = calibrate(_problem(cable(3.0)), GRAVITY, Measured(points, SPACE), ("bending",), path=kernels)
    assert found.intervals["bending"].low < 4e-3 < found.intervals["bending"].high


def test_too_few_points_are_refused() -> None:
    problem = _problem(_cable(4e-3, 5e-3))
    with pytest.raises(CablecosimError, match="1 points are too few for bending"):
        calibrate(problem, GRAVITY, Measured(np.zeros((1, 3)), SPACE), path=kernels)


@pytest.mark.parametrize("heading", ["x [mm], y [mm], z [mm]", "x_mm,y_mm,z_mm", "z (mm),name,x (mm),y(mm)"])
def test_points_are_read_in_the_units_of_their_columns(tmp_path: Path, heading: str) -> None:
    order = [text.strip()[0] for text in heading.split(",")]
    values = {"x": "1", "y": "2e1", "z": "-3", "n": "left"}
    line = ",".join(values[name] for name in order)
    (tmp_path / "p.csv").write_text(heading + "\n" + (line + "\n") * 5, encoding="utf-8")
    measured = read_points(tmp_path / "p.csv")
    assert measured.points.shape == (5, 3)
    assert measured.points[0] == pytest.approx([0.001, 0.02, -0.003])


def test_a_column_that_was_not_measured_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x,z\n" + "1,2\n" * 5, encoding="utf-8")
    assert read_points(tmp_path / "p.csv").axes.tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x,y,z\n1,2,3\n1,oops,3\n" + "1,2,3\n" * 5, "p.csv, line 3: 'oops' is not a coordinate; give a finite number"),
        ("x,y,z\n1,2\n" + "1,2,3\n" * 5, "p.csv, line 2: '' is not a coordinate; give a finite number"),
        ("x,y,z\n1,2,nan\n" + "1,2,3\n" * 5, "p.csv, line 2: 'nan' is not a coordinate; give a finite number"),
        ("x_inch,y,z\n1,2,3\n", "p.csv, line 1: unit 'inch' of 'x_inch' unknown; there are m, cm, mm"),
        ("x,x,z\n1,2,3\n", "p.csv, line 1: has two columns for x; leave one out"),
        ("1,2,3\n", "p.csv, line 1: '1, 2, 3' must name the columns: x, y and z or two, as in 'x [mm], z [mm]'"),
        ("x,y,z\n1,2,3\n", "p.csv: holds 1 points; give 4 to 100000"),
        ("", "p.csv, line 1: '' must name the columns: x"),
    ],
)
def test_a_file_that_holds_no_points_is_refused_with_its_line(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "p.csv").write_text(text, encoding="utf-8")
    with pytest.raises(CablecosimError) as refused:
        read_points(tmp_path / "p.csv")
    assert sentence in str(refused.value)


def test_the_report_says_value_interval_and_deviation(tmp_path: Path) -> None:
    problem = _problem(_cable(4e-3, 5e-3))
    points = _points(problem, 30, 2e-4, np.random.default_rng(9))
    found = calibrate(problem, GRAVITY, Measured(points, SPACE), ("bending",), path=kernels)
    text, report = table(found), json.loads(as_json(found, tmp_path))
    assert "bending" in text
    assert "of the length" in text
    assert report["numbers"]["bending"]["low"] < 4e-3 < report["numbers"]["bending"]["high"]
    assert len(report["deviations"]) == 30
