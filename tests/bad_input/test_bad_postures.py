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
        "21: contacts[0].friction: 'regularized' unknown; there are 'bond', 'none' "
        "('regularized', 'signum' and 'defined' of the paper are not built yet)",
    ),
]


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


def test_a_posture_that_is_not_there_says_so(here: Place) -> None:
    wanted = "cannot be read (no such file or directory); give the path of a .toml file"

    assert here.refused("shape", "posture.toml") == [f"posture.toml: {wanted}"]
