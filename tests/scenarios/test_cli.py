"""The command line from outside: exit codes, sentences, no traceback."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from recordings import SCENE, shape

from protocol.messages import Shape
from scenarios.ask import as_json
from scenarios.children import environment
from scenarios.held_points import HeldPoint
from scenarios.posture import Posture

POSTURE = """
title = "a wire that hangs between two clamps and lies on a floor"
cable = {name = "wire", length = 1.0, diameter = "6 mm", mass_per_length = 0.0174, bending = 1.2e-4, twist = 1.0e-4}
grasps = [{at = 0, position = [0, 0, 0], tangent = [1, 0, 0]}, {at = 1, position = [0.6, 0, 0], tangent = [1, 0, 0]}]
contacts = [{at = 0.5, point = [0.3, 0, -0.3], normal = [0, 0, 1]}]
"""

DRESSED = """
title = "a wire with a sleeve and a connector on it, that slides at one end and is pulled aside"
margin = true
loads = [{at = 0.7, force = [0, "10 mN", 0]}]
[[grasps]]
at = 0
position = [0, 0, 0]
tangent = [1, 0, 0]
[[grasps]]
at = 1
position = [0.6, 0, 0]
tangent = [1, 0, 0]
hold = "guide"
[cable]
name = "wire"
length = 1.0
diameter = "6 mm"
mass_per_length = 0.0174
bending = 1.2e-4
twist = 1.0e-4
stretch = "12 kN"
natural_curvature = ["0.5 1/m", 0, 0]
sections = [{start = 0.4, end = 0.6, mass_per_length = "40 g/m", bending = 5e-4}]
masses = [{at = 0.5, mass = "8 g"}]
"""


def cablecosim(*arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", "from scenarios.cli import main; main()", *map(str, arguments)]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=60, env=environment(), check=False)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["rnu"], 'Unknown command "rnu". Did you mean "run"?'),
        (["run"], "requires an argument"),
        (["run", "harness_asembly"], "did you mean 'harness_assembly'?"),
        (["check", "no.toml"], "no.toml: cannot be read (no such file or directory)"),
        (["check", "harness_assembly", "--set", "cable.length=-1"], "--set cables[0].length: -1 m must be greater than 0 m"),
        (["run", "harness_assembly", "--out", "full"], "full: exists and is not an empty folder"),
        (["replay", "full"], "full: holds no recording.msgpack"),
        (["shape", "no.toml"], "no.toml: cannot be read"),
    ],
)
def test_bad_input_ends_with_code_2_and_a_sentence_and_leaves_nothing(arguments: list[str], sentence: str, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis").touch()
    done = cablecosim(*arguments, folder=tmp_path)

    assert done.returncode == 2
    assert sentence in " ".join((done.stdout + done.stderr).replace("│", " ").split())
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


def test_list_and_check_answer_with_code_0(tmp_path: Path) -> None:
    listed = cablecosim("list", folder=tmp_path)
    checked = cablecosim("check", "harness_assembly", "--resolve", "scene.json", folder=tmp_path)

    assert (listed.returncode, checked.returncode) == (0, 0)
    assert "harness_assembly  A dual-arm robot" in listed.stdout
    assert checked.stdout.startswith("harness_assembly: correct; 1 cable, 2 grippers, 2 bodies")
    assert json.loads((tmp_path / "scene.json").read_text())["cables"][0]["length"] == 1.2


@pytest.mark.thorough
def test_help_stands_at_every_command_and_loads_nothing_slow(tmp_path: Path) -> None:
    code = "import sys; sys.argv = ['cablecosim', {}]\nfrom scenarios.cli import main\ntry: main()\nexcept SystemExit: pass\n"
    slow = "assert not {'pint', 'pydantic', 'zmq', 'scipy', 'numba', 'pybullet', 'trimesh'} & set(sys.modules)"
    for command in ("'--help'", *(f"'{name}', '--help'" for name in ("run", "replay", "list", "check", "shape"))):
        done = subprocess.run(
            [sys.executable, "-c", code.format(command) + slow], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        assert "Usage: cablecosim" in done.stdout


@pytest.mark.thorough
def test_shape_prints_the_shape_of_a_posture_as_json(tmp_path: Path) -> None:
    (tmp_path / "wire.toml").write_text(POSTURE)
    done = cablecosim("shape", "wire.toml", folder=tmp_path)

    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["outcome"] == "converged"
    weight = 9.81 * 0.0174 * 1.0
    upward = sum(wrench[2] for wrench in found["grasp_wrenches"]) + sum(force[2] for force in found["contact_forces"])
    assert upward == pytest.approx(weight, rel=1e-9)
    assert found["contact_forces"][0][2] > 0.0
    touching = min(range(len(found["s"])), key=lambda node: abs(found["s"][node] - found["contact_s"][0]))
    assert found["nodes"][touching][2] == pytest.approx(-0.297, abs=1e-4)  # a radius above the floor; a node lies within half a segment


@pytest.mark.thorough
def test_shape_answers_a_posture_with_parts_on_the_cable_a_guide_and_a_load(tmp_path: Path) -> None:
    (tmp_path / "wire.toml").write_text(DRESSED)
    done = cablecosim("shape", "wire.toml", folder=tmp_path)

    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert set(found["effects"]) == {"gravity", "masses", "loads", "bending", "twist", "preform", "stretch"}
    assert found["margin"] > 0.0
    weight = 9.81 * (0.0174 * 0.8 + 0.04 * 0.2 + 0.008)
    held = [sum(wrench[axis] for wrench in found["grasp_wrenches"]) for axis in range(3)]
    assert held == pytest.approx([0.0, -0.01, weight], abs=1e-9)
    assert found["grasp_wrenches"][1][0] == pytest.approx(0.0, abs=1e-9)  # a guide gives nothing along its tangent


@pytest.mark.thorough
def test_shape_answers_within_a_budget_in_place_of_the_tolerance(tmp_path: Path) -> None:
    (tmp_path / "wire.toml").write_text(POSTURE)
    done = cablecosim("shape", "wire.toml", "--set", "budget=2 s", "--set", "tolerance=1e-12", folder=tmp_path)

    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["error"] > 1e-12


@pytest.mark.thorough
def test_a_posture_without_a_shape_ends_with_code_1_and_the_reason(tmp_path: Path) -> None:
    (tmp_path / "wire.toml").write_text(POSTURE.replace("[0.3, 0, -0.3]", "[0.3, 0, 0.6]"))
    done = cablecosim("shape", "wire.toml", folder=tmp_path)

    assert done.returncode == 1
    assert json.loads(done.stdout)["outcome"] != "converged"
    assert done.stderr.strip() == json.loads(done.stdout)["sentence"]


def test_the_names_in_the_output_of_shape_are_those_of_the_message() -> None:
    posture = Posture(title="a wire", cable=SCENE.cables[0], grasps=(HeldPoint(at=0.0, position=(0.0, 0.0, 0.0)),))
    found = json.loads(json.dumps(as_json(posture, shape()), allow_nan=False))

    assert set(found) == {"title", "grasp_s", *Shape.__struct_fields__}
    assert found["outcome"] == "converged"
