"""A posture file with everything in it: units, relations between its numbers, overrides, and the request that it becomes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from protocol.codec import decode, encode
from protocol.errors import SceneError
from protocol.kinds import Hold, Model
from protocol.scene import LumpedMass, Section
from scenarios.posture import Posture, load_posture

FULL = """\
title = "a wire with everything"
model = "rod"
turns = [1]
branch = 2
budget = "2 ms"
margin = true
[cable]
name = "wire"
length = 1.0
diameter = 0.006
mass_per_length = 0.0174
bending = 1.2e-4
bending_2 = "2 N cm^2"
twist = 1.0e-4
stretch = "12 kN"
natural_curvature = ["0.5 1/m", "90 deg/m", 0]
micro_length = "1 mm"
masses = [{at = "50 cm", mass = "8 g"}]
[[cable.sections]]
start = "20 cm"
end = 0.4
bending = 5e-4
natural_curvature = [0, "2 /m", 0]
[[cable.sections]]
start = 0.4
end = 0.6
mass_per_length = "40 g/m"
stretch = 1e4
[[grasps]]
at = 0
position = [0, 0, 0]
tangent = [1, 0, 0]
[[grasps]]
at = 1.0
position = [0.6, 0, 0]
tangent = [1, 0, 0]
hold = "guide"
[[loads]]
at = 0.7
force = [0, "10 mN", 0]
"""

BAD = [
    # what goes together in a cable
    ("bending_2 =", "bending_2_stiffness =", "13: cable.bending_2_stiffness: unknown key; did you mean 'bending_2'?"),
    (
        'stretch = "12 kN"\n',
        "",
        "27: cable.sections[1].stretch: given for a part of a cable without 'stretch'; give the cable 'stretch' too",
    ),
    ('"12 kN"', '"12 kg"', "15: cable.stretch: '12 kg' is not a force; give a number in N or a string such as \"12 kN\""),
    ('"12 kN"', "1e13", "15: cable.stretch: 1e+13 N must be at most 1e+12 N"),
    (
        '"90 deg/m"',
        '"90 deg"',
        "16: cable.natural_curvature[1]: '90 deg' is not a curvature; give a number in 1/m or a string such as \"0.5 1/m\"",
    ),
    (
        '["0.5 1/m", "90 deg/m", 0]',
        "[1e6, 0, 0]",
        "16: cable.natural_curvature: [1000000.0, 0.0, 0.0] 1/m must be finite, each below 100000",
    ),
    ('["0.5 1/m", "90 deg/m", 0]', "[1, 2]", "16: cable.natural_curvature: 2 numbers are too few; give 3 numbers in 1/m"),
    ('"8 g"', '"8 m"', "18: cable.masses[0].mass: '8 m' is not a mass; give a number in kg or a string such as \"8 g\""),
    ('"50 cm"', "1.5", "18: cable.masses[0].at: 1.5 m lies beyond the end of the cable; give 0 to 1 m"),
    (
        "start = 0.4",
        "start = 0.3",
        "24: cable.sections[1]: from 0.3 to 0.6 m must begin after the one before it, at 0.4 m or later, and end within the cable's 1 m",
    ),
    (
        "end = 0.6",
        "end = 1.6",
        "24: cable.sections[1]: from 0.4 to 1.6 m must begin after the one before it, at 0.4 m or later, and end within the cable's 1 m",
    ),
    ("start = 0.4", "star = 0.4", "25: cable.sections[1].star: unknown key; did you mean 'start'?"),
    ('masses = [{at = "50 cm", mass = "8 g"}]', "masses = 1", "18: cable.masses: 1 is not a list; give a list of tables with at, mass"),
    # what is asked for
    ('model = "rod"', 'model = "beam"', "2: model: 'beam' unknown; there are 'auto', 'taut', 'catenary', 'gradient', 'rod'"),
    ("turns = [1]", "turns = [1, 1]", "3: turns: has 2 entries for 2 clamps; give one from each clamp to the next"),
    ("turns = [1]", "turns = [101]", "3: turns: [101] must lie within -100 and 100"),
    ("turns = [1]", "turns = [0.5]", "3: turns[0]: 0.5 is not a whole number; give a whole number"),
    ("turns = [1]", "turns = 1", "3: turns: 1 is not a list; give a list of whole numbers"),
    ("branch = 2", "branch = -1", "4: branch: -1 must lie within 0 and 100"),
    ("branch = 2", "branch = true", "4: branch: true is not a whole number; give a whole number"),
    ('"2 ms"', '"2 mm"', "5: budget: '2 mm' is not a time; give a number in s or a string such as \"20 ms\""),
    ('"2 ms"', "0", "5: budget: 0 s must be greater than 0 s"),
    ('"2 ms"', '"2 days"', "5: budget: 172800 s must be at most 3600 s"),
    ("margin = true", "margin = 1", "6: margin: 1 is neither true nor false; give true or false"),
    ("at = 0.7", "at = 1.7", "39: loads[0].at: 1.7 m lies beyond the end of the cable; give 0 to 1 m"),
    ('[0, "10 mN", 0]', "[0, nan, 0]", "40: loads[0].force[1]: nan N must be finite"),
    ('[0, "10 mN", 0]', "[0, 0]", "40: loads[0].force: 2 numbers are too few; give 3 numbers in N"),
    ('[0, "10 mN", 0]', "[0, 1e9, 0]", "38: loads.force: holds a value that is not finite, or not below 1e+09"),
    ("force =", "forces =", "40: loads[0].forces: unknown key; did you mean 'force'?"),
]


def write(folder: Path, text: str) -> Path:
    file = folder / "posture.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(("old", "new", "sentence"), BAD)
def test_a_mistake_gives_one_sentence(old: str, new: str, sentence: str, tmp_path: Path) -> None:
    assert FULL.count(old) == 1, old
    file = write(tmp_path, FULL.replace(old, new))

    with pytest.raises(SceneError) as caught:
        load_posture(file)

    assert str(caught.value) == f"{file}:{sentence}"


def test_everything_that_a_posture_asks_for_stands_in_the_request(tmp_path: Path) -> None:
    request = load_posture(write(tmp_path, FULL)).request()
    problem = request.problems[0]

    assert encode(decode(encode(request))) == encode(request)
    assert (request.budget, request.margin) == (0.002, True)
    assert (problem.model, problem.turns, problem.branch) == (Model.ROD, (1,), 2)
    assert problem.grasps.hold == (Hold.CLAMP, Hold.GUIDE)
    assert problem.loads is not None
    assert problem.loads.s.tolist() == [0.7]
    assert problem.loads.force.tolist() == [[0.0, 0.01, 0.0]]


def test_the_numbers_of_a_cable_may_have_any_unit_of_their_kind(tmp_path: Path) -> None:
    cable = load_posture(write(tmp_path, FULL)).cable

    assert (cable.stretch, cable.bending_2, cable.micro_length) == pytest.approx((12e3, 2e-4, 1e-3))
    assert cable.natural_curvature == pytest.approx((0.5, 0.5 * math.pi, 0.0))
    assert cable.masses == (LumpedMass(at=0.5, mass=0.008),)
    assert cable.sections == (
        Section(start=0.2, end=0.4, bending=5e-4, natural_curvature=(0.0, 2.0, 0.0)),
        Section(start=0.4, end=0.6, mass_per_length=0.04, stretch=1e4),
    )


@pytest.mark.parametrize(
    ("text", "value"), [("2 1/m", 2.0), ("2/m", 2.0), ("2 /m", 2.0), ("21/m", 21.0), ("2 m^-1", 2.0), ("0.02 1/cm", 2.0), ("2 rad/m", 2.0)]
)
def test_a_curvature_may_be_written_in_every_usual_way(text: str, value: float, tmp_path: Path) -> None:
    cable = load_posture(write(tmp_path, FULL.replace("0.5 1/m", text))).cable

    assert cable.natural_curvature is not None
    assert cable.natural_curvature[0] == pytest.approx(value)


def test_every_number_that_asks_for_bending_is_named_when_there_is_none(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        load_posture(write(tmp_path, FULL.replace("bending = 1.2e-4\n", "").replace("twist = 1.0e-4\n", "")))

    assert [line.split(": ")[1] for line in str(caught.value).splitlines()] == [
        "cable.bending_2",
        "cable.natural_curvature",
        "cable.micro_length",
        "cable.sections[0].bending",
        "cable.sections[0].natural_curvature",
    ]


def test_a_cable_cannot_be_held_by_guides_alone(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r":29: grasps\.hold: all are guides, along which the cable slides off; add a clamp or a hinge"):
        load_posture(write(tmp_path, FULL.replace("tangent", 'hold = "guide"\ntangent', 1)))


@pytest.mark.parametrize("change", [('hold = "guide"', ""), ('stretch = "12 kN"\n', "")])
def test_a_cable_that_stretches_or_slides_may_be_held_further_apart_than_it_is_long(change: tuple[str, str], tmp_path: Path) -> None:
    far = FULL.replace("0.6, 0, 0", "1.001, 0, 0").replace("stretch = 1e4\n", "")

    assert load_posture(write(tmp_path, far.replace(*change))).grasps[1].position[0] == 1.001
    with pytest.raises(SceneError, match=r"grasps\[1\]\.position: is 1.001 m from grasps\[0\], with 1 m of cable between them"):
        load_posture(write(tmp_path, far.replace('hold = "guide"', "").replace('stretch = "12 kN"\n', "")))


@pytest.mark.parametrize(
    ("setting", "found"),
    [
        ("budget=3 ms", lambda posture: posture.budget == 0.003),
        ("margin=false", lambda posture: posture.margin is False),
        ("model=taut", lambda posture: posture.model is Model.TAUT),
        ("turns=[-2]", lambda posture: posture.turns == (-2,)),
        ("load.force=[0, 0, '-1 N']", lambda posture: posture.loads[0].force == (0.0, 0.0, -1.0)),
        ("cable.sections.1.mass_per_length=0.1", lambda posture: posture.cable.sections[1].mass_per_length == 0.1),
        ("cable.mass.mass=9 g", lambda posture: posture.cable.masses[0].mass == pytest.approx(0.009)),
    ],
)
def test_the_command_line_reaches_every_part_of_a_posture(setting: str, found: Callable[[Posture], bool], tmp_path: Path) -> None:
    assert found(load_posture(write(tmp_path, FULL), [setting]))


def test_a_setting_that_could_mean_several_sections_names_one_of_them(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"there are 2 sections; say which, such as cable\.sections\.0\.bending"):
        load_posture(write(tmp_path, FULL), ["cable.section.bending=0.1"])
