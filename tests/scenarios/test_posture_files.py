"""Posture files: their mistakes in sentences, and the request that they become."""

from __future__ import annotations

from pathlib import Path

import pytest

from protocol.codec import decode, encode
from protocol.errors import SceneError
from protocol.kinds import FRICTION_CODES, Friction, Hold, Model
from scenarios.posture import load_posture

GOOD = """\
title = "a wire"
[cable]
name = "wire"
length = 1.0
diameter = "6 mm"
mass_per_length = 0.0174
bending = 1.2e-4
twist = 1.0e-4
[[grasps]]
at = 1.0
position = [0.6, 0, 0]
tangent = [0, 0, 2]
roll = "90 deg"
[[grasps]]
at = 0
position = [0, 0, 0]
tangent = [0, 0, -1]
hold = "hinge"
[[contacts]]
at = 0.5
point = [0, 0, -0.3]
normal = [0, 0, 2]
friction = "bond"
"""

BAD = [
    ("at = 1.0", "at = 1.1", "10: grasps[0].at: 1.1 m lies beyond the end of the cable; give 0 to 1 m"),
    ("at = 0.5", "at = 5", "20: contacts[0].at: 5 m lies beyond the end of the cable; give 0 to 1 m"),
    ("at = 0.5", "at = -5", "20: contacts[0].at: -5 m must be at least 0 m"),
    ("0.6, 0, 0", "1.6, 0, 0", "11: grasps[0].position: is 1.6 m from grasps[1], with 1 m of cable between them; bring it within 1 m"),
    ("at = 1.0", "at = 0", "15: grasps[1].at: 0 m is where grasps[0] holds the cable already; hold it at two places"),
    (
        "normal = [0, 0, 2]",
        "normal = [0, 0, 0]",
        "22: contacts[0].normal: [0.0, 0.0, 0.0] has no direction; give numbers that are not all zero",
    ),
    ("tangent = [0, 0, -1]", "", "14: grasps[1]: needs either 'tangent' or 'quaternion', one of the two"),
    (
        "tangent = [0, 0, 2]",
        "quaternion = [0, 0, 0, 1]",
        "13: grasps[0].roll: 1.5708 rad goes with 'tangent'; the quaternion holds the roll already",
    ),
    ('"90 deg"', '"90 s"', "13: grasps[0].roll: '90 s' is not an angle; give a number in rad or a string such as \"90 deg\""),
    ("twist = 1.0e-4\n", "", "2: cable.twist: missing; a cable has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)"),
    ('"6 mm"', "1.0", "5: cable.diameter: 1 m must be smaller than the cable's length, 1 m"),
    ('friction = "bond"', 'friction = "defined"', None),
    ('hold = "hinge"', "hold = 1", "18: grasps[1].hold: 1 unknown; there are 'clamp', 'hinge', 'guide'"),
]


def write(folder: Path, text: str) -> Path:
    file = folder / "posture.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(("old", "new", "sentence"), BAD)
def test_a_mistake_gives_one_sentence(old: str, new: str, sentence: str | None, tmp_path: Path) -> None:
    assert GOOD.count(old) == 1, old
    file = write(tmp_path, GOOD.replace(old, new))

    with pytest.raises(SceneError) as caught:
        load_posture(file)

    assert "\n" not in str(caught.value)
    if sentence is not None:
        assert str(caught.value) == f"{file}:{sentence}"


def test_a_posture_becomes_a_request_in_the_order_of_arc_length(tmp_path: Path) -> None:
    request = load_posture(write(tmp_path, GOOD)).request()
    problem = request.problems[0]

    assert encode(decode(encode(request))) == encode(request)
    assert problem.grasps.s.tolist() == [0.0, 1.0]
    assert problem.grasps.hold == (Hold.HINGE, Hold.CLAMP)
    assert problem.contacts is not None
    assert problem.contacts.normal.tolist() == [[0.0, 0.0, 1.0]]
    assert problem.contacts.distance.tolist() == [0.003]
    assert FRICTION_CODES[problem.contacts.friction[0]] is Friction.BOND


def test_a_posture_that_asks_for_nothing_more_leaves_it_out_of_the_request(tmp_path: Path) -> None:
    request = load_posture(write(tmp_path, GOOD)).request()
    problem = request.problems[0]

    assert (request.budget, request.margin) == (None, False)
    assert (problem.loads, problem.model, problem.turns, problem.branch) == (None, Model.AUTO, (), 0)


def test_one_guide_lets_the_whole_cable_slide_as_the_solver_has_it(tmp_path: Path) -> None:
    """The clamps at 0.5 and 1 m are 1.3 m apart, and the guide is elsewhere."""
    clamp = "[[grasps]]\nat = 0.5\nposition = [0.3, 0, 0]\ntangent = [0, 0, 1]\n"
    guide = '[[grasps]]\nat = 0.2\nposition = [0.1, 0, 0]\ntangent = [0, 0, 1]\nhold = "guide"\n'
    far = GOOD.replace("0.6, 0, 0", "1.6, 0, 0")
    file = tmp_path / "posture.toml"
    file.write_text(far + clamp + guide)
    assert len(load_posture(file).grasps) == 4
    file.write_text(far + clamp)
    with pytest.raises(SceneError, match=r"grasps\[0\]\.position: is 1.3 m from grasps\[2\]"):
        load_posture(file)
