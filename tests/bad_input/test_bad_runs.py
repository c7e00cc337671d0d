"""Mistakes that only show when bodies and robot are loaded: through `cablecosim run`, the last line is the sentence."""

from __future__ import annotations

from importlib import resources

import pytest
from asking import Place, replaced
from test_bad_scenes import PLATE, SCENE

LINK = '<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>'
SHAPE = '<collision><geometry><mesh filename="{mesh}"/></geometry></collision>'
JOINT = (
    '<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>'
)
ARMS = '\narms = [{name = "left", tip = "tip"}, {name = "right", tip = "tip"}]'


def urdf(mesh: str = "") -> str:
    shape = SHAPE.format(mesh=mesh) if mesh else ""
    return f'<robot name="pole">{LINK.format(name="base", shape="")}{LINK.format(name="tip", shape=shape)}{JOINT}</robot>'


def harness() -> str:
    return (resources.files("scenarios") / "harness_assembly.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("mesh", "content", "words"),
    [
        ("junk.stl", bytes(range(256)) * 8, ("bodies[0].mesh", "junk.stl", "give")),
        pytest.param(
            "text.obj", b"hello", ("bodies[0].mesh", "text.obj", "holds no triangles; give a surface mesh"), marks=pytest.mark.slow
        ),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", ("bodies[0].mesh", "flat.obj", "holds no triangles; give a surface mesh")),
        pytest.param(
            "far.obj",
            b"v 0 0 0\nv 1e6 0 0\nv 0 1e6 0\nf 1 2 3\n",
            ("bodies[0].mesh", "far.obj", "scale it to metres"),
            marks=pytest.mark.slow,
        ),
        ("part.step", b"ISO-10303-21;", ("bodies[0].mesh", "part.step", "give STL, OBJ, PLY or GLB")),
    ],
)
def test_a_file_that_is_no_mesh_is_named(mesh: str, content: bytes, words: tuple[str, ...], here: Place) -> None:
    here.write(mesh, content)
    here.write("scene.toml", replaced(SCENE, [("plate.obj", mesh)]))
    sentence = here.refused("run", "scene.toml")[-1]

    assert all(word in sentence for word in words), sentence


@pytest.mark.thorough
def test_a_clip_of_a_body_without_clips_is_named(here: Place) -> None:
    here.write("plate.obj", PLATE)
    here.write("scene.toml", replaced(SCENE, [("by = [0, 0, -0.01]", 'clip = "plate.clip_6"')]))

    assert here.refused("run", "scene.toml")[-1] == (
        "moves[0].targets[0].clip: 'plate.clip_6' unknown; there are none; only generated bodies have clips"
    )


@pytest.mark.thorough
def test_two_targets_for_one_gripper_in_one_move_are_refused(here: Place) -> None:
    here.write("plate.obj", PLATE)
    here.write("scene.toml", replaced(SCENE, [("-0.01]}]", '-0.01]}, {gripper = "left", to = [0, 0, 1]}]')]))

    assert here.refused("run", "scene.toml")[-1] == "moves[0].targets[1].gripper: 'left' has a target already; give one target a move"


@pytest.mark.thorough
def test_a_path_that_would_tear_the_cable_is_refused_before_the_run(here: Place) -> None:
    here.write("plate.obj", PLATE)
    here.write("scene.toml", replaced(SCENE, [("by = [0, 0, -0.01]", "by = [0, 2, 0]")]))
    sentence = here.refused("run", "scene.toml")[-1]

    assert all(word in sentence for word in ("moves", "'down'", "'trunk'", "1.2 m")), sentence


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            ("robot.position=[-3, 0, 0]",),
            ("grippers[0]: arm 'left' cannot bring 'left' to", "at the start, it misses by 2", "move the target closer"),
        ),
        pytest.param(
            ("moves.0.targets.0.approach=[-1, 0, 0]",),
            ("grippers[0]: arm 'left' cannot bring 'left' to", "in move 'left arm down'", "move the target closer"),
            marks=pytest.mark.slow,
        ),
        (
            ("moves.3.targets.0.clip=dashboard.clip_66",),
            ("moves[3].targets[0].clip: 'dashboard.clip_66' unknown; there are 'dashboard.clip_1'",),
        ),
        (("grippers.left.arm=middle",), ("grippers[0].arm: 'middle' unknown; the robot has 'left', 'right'",)),
        (("grippers.left.arm=right",), ("grippers[1].arm: 'right' carries 'left' already; give each gripper an arm of its own",)),
    ],
)
def test_what_the_robot_cannot_do_is_said_before_the_run(settings: tuple[str, ...], words: tuple[str, ...], here: Place) -> None:
    sentence = here.refused("run", "harness_assembly", *(word for setting in settings for word in ("--set", setting)))[-1]

    assert all(word in sentence for word in words), sentence


@pytest.mark.parametrize(
    ("text", "arms", "words"),
    [
        # PyBullet reads past the end of the vertices of such a mesh and dies of it.
        (urdf("crash.obj"), ARMS, ("robot.model: ", "robot.urdf' makes PyBullet crash (signal 11); give one that it can load")),
        pytest.param(
            urdf("no.obj"),
            ARMS,
            ("robot.model: PyBullet cannot load", "robot.urdf'; give a valid URDF whose meshes exist"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "hello",
            ARMS,
            ("robot.model: PyBullet cannot load", "robot.urdf'; give a valid URDF whose meshes exist"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            urdf(),
            ARMS.replace('"tip"}]', '"top"}]'),
            ("robot.arms[1]: there is no link 'top'; there are base, tip",),
            marks=pytest.mark.slow,
        ),
        (urdf(), "", ("robot.arms: missing; name at least one arm of", "robot.urdf' with its tip link")),
        (urdf(), ARMS, ("grippers[0]: arm 'left' cannot bring 'left' to", "at the start", "misses by")),
    ],
    ids=["segfault", "mesh missing", "no XML", "tip link unknown", "no arms", "out of reach"],
)
def test_a_robot_file_that_cannot_serve_is_named(text: str, arms: str, words: tuple[str, ...], here: Place) -> None:
    here.write("robot.urdf", text)
    here.write("crash.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 900000000\n")
    here.write("scene.toml", replaced(harness(), [('model = "dual_panda"', f'model = "robot.urdf"{arms}')]))
    sentence = here.refused("run", "scene.toml")[-1]

    assert all(word in sentence for word in words), sentence
