"""Posture files with one mistake each, through `cablecosim shape`."""

from __future__ import annotations

import pytest
from asking import Place, replaced

POSTURE = """\
title = "a wire between two clamps, above a floor"
[cable]
name = "wire"
length = 1.0
diameter = 0.006
mass_per_length = 0.0174
bending = 1.2e-4
twist = 1.0e-4
[[grasps]]
at = 0
position = [0, 0, 0]
tangent = [1, 0, 0]
[[grasps]]
at = 1
position = [0.6, 0, 0]
tangent = [1, 0, 0.5]
[[contacts]]
at = 0.5
point = [0.3, 0, -0.2]
normal = [0, 0, 1]
"""

TITLE = 'title = "a wire between two clamps, above a floor"'
TWIST = "twist = 1.0e-4"

MISTAKES = [
    ("diameter =", "diametre =", "5: cable.diametre: unknown key; did you mean 'diameter'?"),
    ("length = 1.0", 'length = "1 kg"', "4: cable.length: '1 kg' is not a length; give a number in m or a string such as \"9 mm\""),
    ("length = 1.0", "length = nan", "4: cable.length: nan m must be finite"),
    ("length = 1.0", "length = 1.0.0", "4: is no TOML: expected newline or end of document after a statement, column 13"),
    ("mass_per_length = 0.0174", "mass_per_length = -1", "6: cable.mass_per_length: -1 kg/m must be at least 0 kg/m"),
    ("at = 1\n", "at = 1.5\n", "14: grasps[1].at: 1.5 m lies beyond the end of the cable; give 0 to 1 m"),
    ("at = 1\n", "at = 0\n", "14: grasps[1].at: 0 m is where grasps[0] holds the cable already; hold it at two places"),
    ("at = 0.5", "at = -0.5", "18: contacts[0].at: -0.5 m must be at least 0 m"),
    ("[0.6, 0, 0]", "[1.6, 0, 0]", "15: grasps[1].position: is 1.6 m from grasps[0], with 1 m of cable between them; bring it within 1 m"),
    ("[0, 0, 1]", "[0, 0, 0]", "20: contacts[0].normal: [0.0, 0.0, 0.0] has no direction; give numbers that are not all zero"),
    (
        "tangent = [1, 0, 0.5]",
        "quaternion = [0, 0, 0, 0]",
        "16: grasps[1].quaternion: [0.0, 0.0, 0.0, 0.0] has no direction; give numbers that are not all zero",
    ),
    ("tangent = [1, 0, 0.5]", "roll = inf\ntangent = [1, 0, 0.5]", "16: grasps[1].roll: inf rad must be finite"),
    ("point = [0.3, 0, -0.2]", "point = [0.3, nan, -0.2]", "19: contacts[0].point[1]: nan m must be finite"),
    (
        "normal = [0, 0, 1]",
        'normal = [0, 0, 1]\nfriction = "regularized"',
        "21: contacts[0].friction: 'regularized' depends on how the cable came there, which a posture does not say; "
        "there are 'bond', 'none'",
    ),
    # parts of the cable
    (TWIST, f"{TWIST}\ntwist_stiffness = 1", "9: cable.twist_stiffness: unknown key; did you mean 'twist'?"),
    (TWIST, f'{TWIST}\nstretch = "12 kg"', "9: cable.stretch: '12 kg' is not a force; give a number in N or a string such as \"12 kN\""),
    (TWIST, f"{TWIST}\nstretch = 0", "9: cable.stretch: 0 N must be greater than 0 N"),
    (TWIST, f"{TWIST}\nnatural_curvature = 1", "9: cable.natural_curvature: 1 is not a list; give 3 numbers in 1/m"),
    (
        TWIST,
        f"{TWIST}\nnatural_curvature = [0, 1e5, 0]",
        "9: cable.natural_curvature: [0.0, 100000.0, 0.0] 1/m must be finite, each below 100000",
    ),
    (TWIST, f"{TWIST}\nmasses = [{{at = 2, mass = 1}}]", "9: cable.masses[0].at: 2 m lies beyond the end of the cable; give 0 to 1 m"),
    (TWIST, f"{TWIST}\nmasses = [{{at = 1, mass = 0}}]", "9: cable.masses[0].mass: 0 kg must be greater than 0 kg"),
    (
        TWIST,
        f"{TWIST}\nsections = [{{start = 0.5, end = 0.2}}]",
        "9: cable.sections[0]: from 0.5 to 0.2 m must begin after the one before it, at 0 m or later, and end within the cable's 1 m",
    ),
    (
        TWIST,
        f"{TWIST}\nsections = [{{start = 0, end = 0.2, stretch = 1}}]",
        "9: cable.sections[0].stretch: given for a part of a cable without 'stretch'; give the cable 'stretch' too",
    ),
    (TWIST, f"{TWIST}\nsections = [{{start = 0}}]", '9: cable.sections[0].end: missing; give a number in m or a string such as "9 mm"'),
    # loads, and what is asked for
    (TITLE, f"{TITLE}\nloads = [{{at = 0.5, force = [0, 0]}}]", "2: loads[0].force: 2 numbers are too few; give 3 numbers in N"),
    (TITLE, f"{TITLE}\nloads = [{{at = 1.5, force = [0, 0, 1]}}]", "2: loads[0].at: 1.5 m lies beyond the end of the cable; give 0 to 1 m"),
    (TITLE, f"{TITLE}\nloads = [{{at = 1, force = [0, 0, inf]}}]", "2: loads[0].force[2]: inf N must be finite"),
    (TITLE, f"{TITLE}\nloads = 3", "2: loads: 3 is not a list; give a list of tables with at, force"),
    (TITLE, f"{TITLE}\nturns = [1, 2]", "2: turns: has 2 entries for 2 clamps; give one from each clamp to the next"),
    (TITLE, f"{TITLE}\nturns = [1e3]", "2: turns[0]: 1000.0 is not a whole number; give a whole number"),
    (TITLE, f"{TITLE}\nbranch = 1000", "2: branch: 1000 must lie within 0 and 100"),
    (TITLE, f'{TITLE}\nmodel = "beam"', "2: model: 'beam' unknown; there are 'auto', 'taut', 'catenary', 'gradient', 'rod'"),
    (TITLE, f"{TITLE}\nbudget = -1", "2: budget: -1 s must be greater than 0 s"),
    (TITLE, f'{TITLE}\nmargin = "yes"', "2: margin: 'yes' is neither true nor false; give true or false"),
    ("[1, 0, 0.5]", '[1, 0, 0.5]\nhold = "glue"', "17: grasps[1].hold: 'glue' unknown; there are 'clamp', 'hinge', 'guide'"),
]


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("old", "new", "sentence"), MISTAKES, ids=[f"{old} -> {new}".replace("\n", " ") for old, new, _ in MISTAKES])
def test_a_mistake_in_a_posture_gets_one_sentence(old: str, new: str, sentence: str, here: Place) -> None:
    here.write("posture.toml", replaced(POSTURE, [(old, new)]))

    assert here.refused("shape", "posture.toml") == [f"posture.toml:{sentence}"]


@pytest.mark.parametrize(("old", "key"), [("mass_per_length = 0.0174", "cable.mass_per_length"), ("bending = 1.2e-4", "cable.bending")])
def test_a_number_beyond_all_cables_is_refused_with_its_key_and_value(old: str, key: str, here: Place) -> None:
    here.write("posture.toml", replaced(POSTURE, [(old, f"{old.split(' = ')[0]} = 1e300")]))
    lines = here.refused("shape", "posture.toml")

    assert len(lines) == 1
    assert f"{key}: 1e+300" in lines[0]
    assert "at most" in lines[0]


def test_a_cable_that_only_guides_hold_is_refused(here: Place) -> None:
    here.write("posture.toml", POSTURE.replace("tangent", 'hold = "guide"\ntangent'))
    sentence = "all are guides, along which the cable slides off; add a clamp or a hinge"

    assert here.refused("shape", "posture.toml") == [f"posture.toml:9: grasps.hold: {sentence}"]


def test_more_sections_than_a_message_may_hold_are_refused(here: Place) -> None:
    sections = ", ".join(f"{{start = {k}e-4, end = {k + 1}e-4}}" for k in range(1001))
    here.write("posture.toml", replaced(POSTURE, [(TWIST, f"{TWIST}\nsections = [{sections}]")]))

    assert here.refused("shape", "posture.toml") == ["posture.toml:9: cable.sections: 1001 entries are too many; at most 1000"]


def test_a_setting_is_named_when_it_does_not_go_together_with_the_file(here: Place) -> None:
    here.write("posture.toml", POSTURE)

    assert here.refused("shape", "posture.toml", "--set", "turns=[1, 1]") == [
        "--set turns: has 2 entries for 2 clamps; give one from each clamp to the next"
    ]


def test_a_posture_that_is_not_there_says_so(here: Place) -> None:
    wanted = "cannot be read (no such file or directory); give the path of a .toml file"

    assert here.refused("shape", "posture.toml") == [f"posture.toml: {wanted}"]
