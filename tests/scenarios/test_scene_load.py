"""Every kind of bad scene gives one sentence with file, line, key, value and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from protocol import scene_file
from protocol.errors import SceneError
from protocol.kinds import Friction
from protocol.scene import Scene
from scenarios.load import built_in, load, scene_name, write_resolved

GOOD = """\
# a scene with everything in it
title = "small"

[[cables]]
name = "trunk"
length = 1.2
diameter = "9 mm"
mass_per_length = "90 g/m"
bending = "200 N cm^2"
twist = 0.016

[robot]
model = "dual_panda"

[[bodies]]
name = "part"
mesh = "part.stl"
friction = "bond"

[[grippers]]
name = "left"
cable = "trunk"
at = 0
position = [0, "300 mm", 1.0]
tangent = [0, -1, 0]

[[grippers]]
name = "right"
cable = "trunk"
at = 1.2
position = [0, -0.3, 1.0]
tangent = [0, -1, 0]

[[moves]]
name = "down"
duration = "500 ms"
targets = [
    {gripper = "left", by = [0, 0, "-1 cm"]},  # a comment, with a } and a "
    {gripper = "right", to = [0, -0.2, 1.0]},
]

[[pictures]]
name = "end"
after = "down"
"""

BAD = [  # what is replaced, by what, and the sentence after the file's name
    ("bending =", "bending_stifness =", "9: cables[0].bending_stifness: unknown key; did you mean 'bending'?"),
    ("[robot]", "[roboter]", "12: roboter: unknown key; did you mean 'robot'?"),
    (
        '[[pictures]]\nname = "end"',
        "[[xyz]]",
        "42: xyz: unknown key; there are title, cables, grippers, moves, bodies, robot, pictures, gravity, time_step, tolerance, "
        "relaxation, effects, audit_every",
    ),
    ("length = 1.2", "", '4: cables[0].length: missing; give a number in m or a string such as "9 mm"'),
    ("length = 1.2", "length = -1.2", "6: cables[0].length: -1.2 m must be greater than 0 m"),
    ("length = 1.2", "length = true", '6: cables[0].length: true is not a length; give a number in m or a string such as "9 mm"'),
    ("length = 1.2", "length = inf", "6: cables[0].length: inf m must be finite"),
    ("length = 1.2", "length = nan", "6: cables[0].length: nan m must be finite"),
    ("length = 1.2", 'length = "abc"', "6: cables[0].length: 'abc' is not a length; give a number in m or a string such as \"9 mm\""),
    ("length = 1.2", 'length = "1.2"', "6: cables[0].length: '1.2' is not a length; give a number in m or a string such as \"9 mm\""),
    ("length = 1.2", 'length = "1 kg"', "6: cables[0].length: '1 kg' is not a length; give a number in m or a string such as \"9 mm\""),
    ("length = 1.2", 'length = "1 mm 3"', "6: cables[0].length: '1 mm 3' is not a length; give a number in m or a string such as \"9 mm\""),
    (
        "length = 1.2",
        'length = "2 zorks"',
        "6: cables[0].length: '2 zorks' is not a length; give a number in m or a string such as \"9 mm\"",
    ),
    ("length = 1.2", 'length = "9 m("', "6: cables[0].length: '9 m(' is not a length; give a number in m or a string such as \"9 mm\""),
    ("length = 1.2", 'length = "1e308 km"', "6: cables[0].length: inf m must be finite"),
    ("length = 1.2", "length = [1.2]", '6: cables[0].length: [1.2] is not a length; give a number in m or a string such as "9 mm"'),
    ("length = 1.2", "length = 1e5", "6: cables[0].length: 100000 m must be below 10000 m"),
    (
        '"90 g/m"',
        '"90 g"',
        "8: cables[0].mass_per_length: '90 g' is not a mass per length; give a number in kg/m or a string such as \"90 g/m\"",
    ),
    ("twist = 0.016", "", "4: cables[0].twist: missing; a cable has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)"),
    ('diameter = "9 mm"', "diameter = 2", "7: cables[0].diameter: 2 m must be smaller than the cable's length, 1.2 m"),
    (
        '"bond"',
        '"sticky"',
        "18: bodies[0].friction: 'sticky' unknown; there are 'bond', 'none', 'regularized', 'signum', 'defined'",
    ),
    ('"bond"', '"signum"', "15: bodies[0].friction_coefficient: missing; friction 'signum' needs it"),
    (
        '"bond"',
        '"bond"\nfriction_coefficient = 0.3',
        "19: bodies[0].friction_coefficient: given for friction 'bond'; it has no numbers",
    ),
    (
        '"bond"',
        '"regularized"\nfriction_coefficient = 0.3',
        "15: bodies[0].friction_speed: missing; friction 'regularized' needs it",
    ),
    (
        '"bond"',
        '"regularized"\nfriction_coefficient = 0.3\nfriction_speed = "3 mm"',
        "20: bodies[0].friction_speed: '3 mm' is not a speed; give a number in m/s or a string such as \"20 mm/s\"",
    ),
    (
        '"bond"',
        '"signum"\nfriction_coefficient = -0.1',
        "19: bodies[0].friction_coefficient: -0.1 must be at least 0",
    ),
    (
        '"bond"',
        '"defined"\nfriction_table = [[0.0, 0.4], [0.0, 0.3]]',
        "19: bodies[0].friction_table: the speeds must begin with 0 and grow strictly",
    ),
    (
        '"bond"',
        '"defined"\nfriction_table = [[0.0, 0.4, 1.0]]',
        "19: bodies[0].friction_table: every row must have a speed and a coefficient",
    ),
    ('"part.stl"', "7", "17: bodies[0].mesh: 7 is not a text; give a text in quotes"),
    ('mesh = "part.stl"', 'generate = "wing"', "17: bodies[0].generate: 'wing' unknown; there are 'dashboard', 'beam'"),
    ('mesh = "part.stl"', "", "15: bodies[0]: 'part' needs either 'generate', 'mesh' or 'shape', one of the three"),
    ('"dual_panda"', '"r2d2"', "13: robot.model: 'r2d2' unknown; there is 'dual_panda', or give a .urdf file"),
    ("at = 1.2", "at = 1.3", "30: grippers[1].at: 1.3 m lies beyond the end of cable 'trunk'; give 0 to 1.2 m"),
    ("at = 1.2", "at = 0", "20: grippers: 'left' and 'right' hold cable 'trunk' at the same 0 m; hold it at two places"),
    (
        '"300 mm"',
        "3",
        "20: grippers: 'left' and 'right' start 3.3 m apart, further than the 1.2 m of cable 'trunk' between them; bring them within 1.2 m",
    ),
    ('"300 mm", 1.0', "1.0", "24: grippers[0].position: 2 numbers are too few; give 3 numbers in m"),
    ('"300 mm", 1.0', "1, 2, 3", "24: grippers[0].position: 4 numbers are too many; give 3 numbers in m"),
    (
        "tangent = [0, -1, 0]\n\n[[g",
        "tangent = [0, 0, 0]\n\n[[g",
        "25: grippers[0].tangent: [0.0, 0.0, 0.0] has no direction; give a vector that is not zero",
    ),
    ('cable = "trunk"\nat = 0', 'cable = "trunc"\nat = 0', "22: grippers[0].cable: 'trunc' unknown; there are 'trunk'"),
    ('"-1 cm"', '"-1 s"', "38: moves[0].targets[0].by[2]: '-1 s' is not a length; give a number in m or a string such as \"9 mm\""),
    ("to = [0, -0.2", "too = [0, -0.2", "39: moves[0].targets[1].too: unknown key; did you mean 'to'?"),
    ('after = "down"', 'after = "up"', "44: pictures[0].after: 'up' unknown; there are 'down'"),
    ('title = "small"', 'title = ""', "2: title: must not be empty; give a text in quotes"),
    ('title = "small"', "", ": title: missing; give a text in quotes"),
    ('title = "small"', "title = 'a'\ngravity = 9.81", "3: gravity: 9.81 is not a list; give 3 numbers in m/s^2"),
    ('title = "small"', "title = 'a'\ntime_step = 11", "3: time_step: 11 s must be at most 10 s"),
    ('title = "small"', "title = 'a'\ntime_step = 1979-05-27", None),
    ('title = "small"', "title = ", "2: is no TOML: invalid value, column 9"),
    ('title = "small"', "title = 'a'\nmoves = 3", None),
]


def write(folder: Path, text: str) -> Path:
    (folder / "part.stl").write_text("solid")
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def sentences(file: Path, *overrides: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        load(file, overrides)
    return [line.removeprefix(f"{file}:") for line in str(caught.value).splitlines()]


def test_a_good_scene_is_read_with_its_units_converted_and_its_paths_absolute(tmp_path: Path) -> None:
    scene = load(write(tmp_path, GOOD))

    cable = scene.cables[0]
    assert (cable.diameter, cable.mass_per_length, cable.bending) == pytest.approx((0.009, 0.09, 0.02))
    assert scene.grippers[0].position == (0.0, 0.3, 1.0)
    assert scene.moves[0].duration == 0.5
    assert scene.moves[0].targets[0].by == (0.0, 0.0, -0.01)
    assert scene.bodies[0].mesh == str(tmp_path / "part.stl")
    assert scene.bodies[0].friction is Friction.BOND


@pytest.mark.parametrize(("old", "new", "sentence"), BAD)
def test_a_mistake_gives_one_sentence(old: str, new: str, sentence: str | None, tmp_path: Path) -> None:
    assert GOOD.count(old) == 1, old
    found = sentences(write(tmp_path, GOOD.replace(old, new)))

    assert len(found) == 1
    if sentence is not None:
        assert found[0] == sentence.removeprefix(":")


@pytest.mark.parametrize("change", [("bending =", 'stretch = "2 kN"\nbending ='), ("at = 1.2", 'at = 1.2\nhold = "guide"')])
def test_a_cable_that_stretches_or_slides_may_start_further_apart_than_it_is_long(change: tuple[str, str], tmp_path: Path) -> None:
    assert load(write(tmp_path, GOOD.replace('"300 mm"', "3").replace(*change))).grippers[0].position[1] == 3.0


@pytest.mark.parametrize(("name", "entry"), [("sections", "{{start = {0}e-4, end = {1}e-4}}"), ("masses", '{{at = {0}e-4, mass = "1 g"}}')])
def test_a_cable_of_more_parts_than_a_message_may_hold_is_refused(name: str, entry: str, tmp_path: Path) -> None:
    def scene(count: int) -> str:
        parts = ", ".join(entry.format(k, k + 1) for k in range(count))
        return GOOD.replace("twist = 0.016", f"twist = 0.016\n{name} = [{parts}]")

    assert sentences(write(tmp_path, scene(1001))) == [f"11: cables[0].{name}: 1001 entries are too many; at most 1000"]
    assert len(getattr(load(write(tmp_path, scene(1000))).cables[0], name)) == 1000


def test_all_mistakes_are_told_at_once_in_the_order_of_lines(tmp_path: Path) -> None:
    text = GOOD
    for old, new in (("bending =", "bendin ="), ('"300 mm"', '"x"'), ('"bond"', '"glue"'), ("length = 1.2", "length = 0")):
        text = text.replace(old, new)

    assert [line.split(": ")[1] for line in sentences(write(tmp_path, text))] == [
        "cables[0].length",
        "cables[0].bendin",
        "bodies[0].friction",
        "grippers[0].position[1]",
    ]


def test_a_mesh_that_does_not_exist_or_is_empty_is_named_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "empty.stl").touch()
    wanted = "give a mesh file such as part.stl"

    assert sentences(write(tmp_path, GOOD.replace("part.stl", "no.stl"))) == [
        f"17: bodies[0].mesh: 'no.stl' does not exist as {tmp_path / 'no.stl'}; {wanted}, relative to the scene file"
    ]
    assert sentences(write(tmp_path, GOOD.replace("part.stl", "empty.stl"))) == [
        f"17: bodies[0].mesh: 'empty.stl' is an empty file; {wanted}"
    ]


def test_files_that_are_no_scenes_are_refused_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "latin.toml").write_bytes(b'title = "\xe9"')
    for name, end in (
        ("no.toml", "cannot be read (no such file or directory); give the path of a .toml file"),
        ("", "cannot be read (is a directory); give the path of a .toml file"),
        ("latin.toml", "is no text in UTF-8; save it as UTF-8"),
    ):
        with pytest.raises(SceneError) as caught:
            load(tmp_path / name)
        assert str(caught.value) == f"{tmp_path / name}: {end}"


def test_an_unknown_name_is_answered_with_the_names_that_exist() -> None:
    with pytest.raises(SceneError, match="scene 'harness_asembly' unknown; did you mean 'harness_assembly'"):
        load("harness_asembly")
    with pytest.raises(SceneError, match="scene 'xyz' unknown; there are 'case_study_1', 'harness_assembly', 'touch_down'"):
        load("xyz")


@pytest.mark.parametrize("name", built_in())
def test_every_built_in_scene_is_correct_and_says_what_it_is(name: str) -> None:
    assert load(name).title


def test_the_harness_scene_has_what_its_description_promises() -> None:
    scene = load("harness_assembly")

    assert scene.cables[0].length == 1.2
    assert len(scene.pictures) == 5
    assert sum(move.duration for move in scene.moves) / scene.time_step >= 300


def test_a_scene_is_named_after_its_file() -> None:
    assert scene_name("some/where/my_scene.toml") == scene_name("my_scene") == "my_scene"


def test_a_resolved_scene_is_read_back_as_it_was(tmp_path: Path) -> None:
    scene = load(write(tmp_path, GOOD))
    write_resolved(scene, tmp_path / "scene.json")

    assert scene_file.read((tmp_path / "scene.json").read_bytes()) == scene


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (b"{", b"", "not a resolved scene"),
        (b'"length": 1.2', b'"length": -1.2', r"cables\[0\].length: -1.2 must be greater than 0"),
        (b'"length": 1.2', b'"length": "x"', "not a resolved scene"),
        (b'"bending": 0.02', b'"bending": 0.0', r"cables\[0\].bending: 0 must be greater than 0"),
        (b'"time_step": 0.02', b'"time_step": 20.0', "time_step: 20 must be at most 10"),
        (b'"after": "down"', b'"after": "up"', r"pictures\[0\].after: 'up' unknown"),
        (b'"title": "small"', b'"title": ""', "title: must not be empty"),
    ],
)
def test_a_resolved_scene_that_was_spoiled_is_refused(old: bytes, new: bytes, sentence: str, tmp_path: Path) -> None:
    data = scene_file.write(load(write(tmp_path, GOOD)))
    assert old in data

    with pytest.raises(SceneError, match=sentence):
        scene_file.read(data.replace(old, new, 1))


def test_overrides_reach_values_by_index_by_name_and_by_the_singular(tmp_path: Path) -> None:
    file = write(tmp_path, GOOD)

    def length(override: str) -> float:
        scene: Scene = load(file, [override])
        return scene.cables[0].length

    assert (
        length("cables.0.length=1.3")
        == length("cables.trunk.length=1.3")
        == length("cable.length=1.3")
        == length("cable.length=1300 mm")
        == 1.3
    )
    assert load(file, ["time_step=0.01"]).time_step == 0.01
    assert load(file, ["gravity=[0, 0, 0]"]).gravity == (0.0, 0.0, 0.0)
    assert load(file, ["body.friction=none"]).bodies[0].friction is Friction.NONE
    assert load(file, ["moves.down.targets.0.by.2=-0.02"]).moves[0].targets[0].by == (0.0, 0.0, -0.02)
    assert load(file, ["robot.model=dual_panda", "title='x = 1'"]).title == "x = 1"


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("cable.bending=abc", "cables[0].bending: 'abc' is not a stiffness; give a number in N m^2 or a string such as \"0.02 N m^2\""),
        ("cable.bendin=1", "cables[0].bendin: unknown key; did you mean 'bending'?"),
        ("cable.bending", "'cable.bending' is no setting; give one such as cable.bending=0.01"),
        ("gripper.at=0.1", "gripper.at: there are 2 grippers; say which, such as grippers.left.at"),
        ("grippers.middle.at=0.1", "grippers.middle.at: 'middle' unknown; there are 'left', 'right'"),
        ("grippers.7.at=0.1", "grippers.7.at: '7' unknown; there are 'left', 'right'"),
        ("cabels.0.length=1", "cabels.0.length: 'cabels' unknown; did you mean 'cables'?"),
        ("title.x=1", "title.x: title holds 'small' and no table; nothing lies below it"),
        ("time_stp=1", "time_stp: unknown key; did you mean 'time_step'?"),
    ],
)
def test_a_wrong_override_is_told_as_such(override: str, sentence: str, tmp_path: Path) -> None:
    assert sentences(write(tmp_path, GOOD), override) == [f"--set {sentence}"]
