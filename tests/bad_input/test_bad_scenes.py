"""Scene files with one mistake each, through `cablecosim check`: one sentence that names the key, its value and what is right."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from asking import Place, replaced

SCENE = """\
title = "two hands above a plate"
time_step = 0.02
[[cables]]
name = "trunk"
length = 1.2
diameter = 0.009
mass_per_length = 0.09
bending = 0.02
twist = 0.0164
[[bodies]]
name = "plate"
mesh = "plate.obj"
[[grippers]]
name = "left"
cable = "trunk"
at = 0
position = [0, 0.4, 1.0]
tangent = [0, -1, 0]
[[grippers]]
name = "right"
cable = "trunk"
at = 1.2
position = [0, -0.4, 1.1]
tangent = [0, -1, 0.1]
[[moves]]
name = "down"
duration = 0.2
targets = [{gripper = "left", by = [0, 0, -0.01]}]
[[pictures]]
name = "low"
after = "down"
"""
PLATE = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n"
LENGTH = 'give a number in m or a string such as "9 mm"'
STIFFNESS = 'give a number in N m^2 or a string such as "0.02 N m^2"'

MISTAKES = [
    # unknown keys and names
    ("bending = 0.02", "bendin = 0.02", "8: cables[0].bendin: unknown key; did you mean 'bending'?"),
    ("time_step = 0.02", "time_stp = 0.02", "2: time_stp: unknown key; did you mean 'time_step'?"),
    ("length = 1.2", "lenght = 1.2", "5: cables[0].lenght: unknown key; did you mean 'length'?"),
    ('cable = "trunk"\nat = 1.2', 'cable = "trnk"\nat = 1.2', "21: grippers[1].cable: 'trnk' unknown; there are 'trunk'"),
    ('gripper = "left"', 'gripper = "lefft"', "28: moves[0].targets[0].gripper: 'lefft' unknown; there are 'left', 'right'"),
    ('after = "down"', 'after = "up"', "31: pictures[0].after: 'up' unknown; there are 'down'"),
    ("by = [0, 0, -0.01]", 'clip = "dash.clip_6"', "28: moves[0].targets[0].clip: 'dash' unknown; there are 'plate'"),
    (
        "by = [0, 0, -0.01]",
        'clip = "clip_6"',
        "28: moves[0].targets[0].clip: 'clip_6' must be 'body.clip', such as 'dashboard.clip_1'",
    ),
    ("at = 1.2", 'at = 1.2\narm = "middle"', "23: grippers[1].arm: 'middle' needs a [robot] in the scene"),
    (
        "time_step = 0.02",
        'robot = {model = "r2d2"}',
        "2: robot.model: 'r2d2' unknown; there is 'dual_panda', or give a .urdf file",
    ),
    # types
    ("length = 1.2", "length = true", f"5: cables[0].length: true is not a length; {LENGTH}"),
    ("length = 1.2", "length = [1.2]", f"5: cables[0].length: [1.2] is not a length; {LENGTH}"),
    ("length = 1.2", "length = 1979-05-27", f"5: cables[0].length: '1979-05-27' is not a length; {LENGTH}"),
    ('"plate.obj"', "7", "12: bodies[0].mesh: 7 is not a text; give a text in quotes"),
    ("[0, 0.4, 1.0]", "[0, 0.4]", "17: grippers[0].position: 2 numbers are too few; give 3 numbers in m"),
    ("[0, 0.4, 1.0]", "{x = 1}", '17: grippers[0].position: {"x": 1} is not a list; give 3 numbers in m'),
    ("[0, 0.4, 1.0]", '[0, "x", 1]', f"17: grippers[0].position[1]: 'x' is not a length; {LENGTH}"),
    # units
    ("length = 1.2", 'length = "3 kg"', f"5: cables[0].length: '3 kg' is not a length; {LENGTH}"),
    ("length = 1.2", 'length = "long"', f"5: cables[0].length: 'long' is not a length; {LENGTH}"),
    ("length = 1.2", 'length = "3 degC"', f"5: cables[0].length: '3 degC' is not a length; {LENGTH}"),
    ("bending = 0.02", 'bending = "2 N m"', f"8: cables[0].bending: '2 N m' is not a stiffness; {STIFFNESS}"),
    # numbers
    ("length = 1.2", "length = nan", "5: cables[0].length: nan m must be finite"),
    ("length = 1.2", "length = inf", "5: cables[0].length: inf m must be finite"),
    ("length = 1.2", "length = 1e999", "5: cables[0].length: inf m must be finite"),
    ("length = 1.2", "length = -1.2", "5: cables[0].length: -1.2 m must be greater than 0 m"),
    ("length = 1.2", "length = 0", "5: cables[0].length: 0 m must be greater than 0 m"),
    ("length = 1.2", "length = 1e300", "5: cables[0].length: 1e+300 m must be below 10000 m"),
    ("mass_per_length = 0.09", "mass_per_length = -1", "7: cables[0].mass_per_length: -1 kg/m must be at least 0 kg/m"),
    ("bending = 0.02", "bending = 0", "8: cables[0].bending: 0 N m^2 must be greater than 0 N m^2"),
    ("[0, 0.4, 1.0]", "[0, nan, 1.0]", "17: grippers[0].position[1]: nan m must be finite"),
    ("[0, 0.4, 1.0]", "[0, 1e9, 1.0]", "17: grippers[0].position[1]: 1e+09 m must be below 10000 m"),
    ("time_step = 0.02", "time_step = 0", "2: time_step: 0 s must be greater than 0 s"),
    ("time_step = 0.02", "tolerance = -1", "2: tolerance: -1 m must be greater than 0 m"),
    ("time_step = 0.02", "gravity = [0, 0, inf]", "2: gravity[2]: inf m/s^2 must be finite"),
    ("duration = 0.2", "duration = -1", "27: moves[0].duration: -1 s must be greater than 0 s"),
    # geometry
    ("at = 1.2", "at = 1.3", "22: grippers[1].at: 1.3 m lies beyond the end of cable 'trunk'; give 0 to 1.2 m"),
    ("at = 1.2", "at = 0", "13: grippers: 'left' and 'right' hold cable 'trunk' at the same 0 m; hold it at two places"),
    (
        "[0, 0.4, 1.0]",
        "[0, 3, 1.1]",
        "13: grippers: 'left' and 'right' start 3.4 m apart, further than the 1.2 m of cable 'trunk' between them; bring them within 1.2 m",
    ),
    (
        "tangent = [0, -1, 0.1]",
        "tangent = [0, 0, 0]",
        "24: grippers[1].tangent: [0.0, 0.0, 0.0] has no direction; give a vector that is not zero",
    ),
    ("twist = 0.0164\n", "", "3: cables[0].twist: missing; a cable has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)"),
    # parts of a cable
    (
        "bending = 0.02",
        "bending = 0.02\nsections = [{start = 0, end = 1.3}]",
        "9: cables[0].sections[0]: from 0 to 1.3 m must begin after the one before it, at 0 m or later, and end within the cable's 1.2 m",
    ),
    (
        "bending = 0.02",
        "bending = 0.02\nsections = [{start = 0, end = 1, stretch = 1}]",
        "9: cables[0].sections[0].stretch: given for a part of a cable without 'stretch'; give the cable 'stretch' too",
    ),
    (
        "bending = 0.02",
        'bending = 0.02\nmasses = [{at = "2 m", mass = "8 g"}]',
        "9: cables[0].masses[0].at: 2 m lies beyond the end of the cable; give 0 to 1.2 m",
    ),
    (
        "bending = 0.02\ntwist = 0.0164\n",
        "micro_length = 0.01\n",
        "8: cables[0].micro_length: given for a cable without 'bending'; give the cable 'bending' and 'twist' too",
    ),
    ("bending = 0.02", "bending_stiffness = 0.02", "8: cables[0].bending_stiffness: unknown key; did you mean 'bending'?"),
    # names given twice
    ('name = "right"', 'name = "left"', "13: grippers: the name 'left' is given 2 times; names must differ"),
    (
        "[[pictures]]",
        '[[moves]]\nname = "down"\nduration = 1\n[[pictures]]',
        "25: moves: the name 'down' is given 2 times; names must differ",
    ),
    # TOML
    ("length = 1.2", "length = = 1.2", "5: is no TOML: invalid value, column 10"),
    ("[[cables]]", "[[cables", "3: is no TOML: expected ']]' at the end of an array declaration, column 9"),
    ("length = 1.2", "length = 1.2\nlength = 1.3", "6: is no TOML: cannot overwrite a value, column 13"),
    # files
    (
        "plate.obj",
        "no.stl",
        "12: bodies[0].mesh: 'no.stl' does not exist as {folder}/no.stl; give a mesh file such as part.stl, relative to the scene file",
    ),
    ("plate.obj", "empty.stl", "12: bodies[0].mesh: 'empty.stl' is an empty file; give a mesh file such as part.stl"),
    (
        "time_step = 0.02",
        'robot = {model = "no.urdf"}',
        "2: robot.model: 'no.urdf' does not exist as {folder}/no.urdf; give a .urdf file, relative to the scene file",
    ),
]


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("old", "new", "sentence"), MISTAKES, ids=[f"{old} -> {new}" for old, new, _ in MISTAKES])
def test_a_mistake_in_a_scene_gets_one_sentence(old: str, new: str, sentence: str, here: Place) -> None:
    here.write("plate.obj", PLATE)
    here.write("empty.stl", "")
    here.write("scene.toml", replaced(SCENE, [(old, new)]))

    assert here.refused("check", "scene.toml") == [f"scene.toml:{sentence.replace('{folder}', str(here.work.resolve()))}"]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("old", "new", "key", "value"),
    [
        ('mesh = "plate.obj"', 'mesh = "plate.obj"\nquaternion = [0, 0, 0, 0]', "bodies[0].quaternion", "[0.0, 0.0, 0.0, 0.0]"),
        ("time_step = 0.02", "robot = {quaternion = [0, 0, 0, 0]}", "robot.quaternion", "[0.0, 0.0, 0.0, 0.0]"),
        ("tangent = [0, -1, 0.1]", "tangent = [0, -1e200, 0]", "grippers[1].tangent", "1e+200"),
        ("time_step = 0.02", "time_step = 1e-12", "time_step", "1e-12"),
        ("duration = 0.2", "duration = 1e300", "time_step", "5e+301"),
        ("mass_per_length = 0.09", "mass_per_length = 1e300", "cables[0].mass_per_length", "1e+300"),
        ("bending = 0.02", "bending = 1e300", "cables[0].bending", "1e+300"),
        ("tangent = [0, -1, 0.1]", "tangent = [0, 0, 1]", "grippers[1].approach", "[0.0, 0.0, -1.0]"),
        (
            "time_step = 0.02",
            'robot = {arms = [{name = "left", tip = "left_grasp"}, {name = "left", tip = "right_grasp"}]}',
            "robot.arms",
            "'left'",
        ),
        ("[[pictures]]", '[[pictures]]\nname = "low"\n[[pictures]]', "pictures", "'low'"),
        ("time_step = 0.02", f"x = {'[' * 3000}{']' * 3000}", "", "deep"),
    ],
)
def test_what_no_program_could_work_with_is_refused_when_it_is_checked(old: str, new: str, key: str, value: str, here: Place) -> None:
    here.write("plate.obj", PLATE)
    here.write("scene.toml", replaced(SCENE, [(old, new)]))
    lines = here.refused("check", "scene.toml")

    assert len(lines) == 1
    assert lines[0].startswith("scene.toml")
    assert key in lines[0]
    assert value in lines[0]


def test_every_mistake_in_a_scene_gets_a_sentence_of_its_own(here: Place) -> None:
    here.write("scene.toml", replaced(SCENE, [("length = 1.2", "length = nan"), ("twist =", "twst ="), ("plate.obj", "no.obj")]))

    # A file is looked for once the types are right, so that two sentences never contradict each other.
    assert [line.split(": ")[1] for line in here.refused("check", "scene.toml")] == ["cables[0].length", "cables[0].twst"]


@pytest.mark.parametrize(
    ("content", "sentences"),
    [
        ("", ["title: missing", "cables: missing", "grippers: missing"]),
        ("# nothing but a comment\n", ["title: missing", "cables: missing", "grippers: missing"]),
        (b"\x00\xff\xfe\x80binary", ["is no text in UTF-8; save it as UTF-8"]),
    ],
)
def test_a_file_that_holds_no_scene_is_refused(content: str | bytes, sentences: list[str], here: Place) -> None:
    here.write("scene.toml", content)
    lines = here.refused("check", "scene.toml")

    assert [line.removeprefix("scene.toml: ").split(";")[0] for line in lines] == [one.split(";")[0] for one in sentences]


def test_a_folder_is_no_scene(here: Place) -> None:
    assert here.refused("check", ".") == [".: cannot be read (is a directory); give the path of a .toml file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_a_scene_that_may_not_be_read_says_so(here: Place) -> None:
    file: Path = here.write("scene.toml", SCENE)
    file.chmod(0o000)
    try:
        line = here.refused("check", "scene.toml")
    finally:
        file.chmod(0o600)

    assert line == ["scene.toml: cannot be read (permission denied); give the path of a .toml file"]
