"""`cablecosim calibrate` from a file of points to a table and a JSON file."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenarios.children import environment

POSTURE = """\
title = "a wire between two clamps"
tolerance = 1e-6
[cable]
name = "wire"
length = 1.0
diameter = "6 mm"
mass_per_length = "50 g/m"
bending = {bending}
twist = 5e-3
[[grasps]]
at = 0
position = [0, 0, 0]
tangent = [1, 0, 0]
[[grasps]]
at = 1
position = [0.6, 0, 0.1]
tangent = [1, 0, 0]
"""


def _cablecosim(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from scenarios.cli import main; main()", *words],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A posture with a first guess, and points of the same cable with EI = 4e-3 N m^2, 0.2 mm of noise in them."""
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "truth.toml").write_text(POSTURE.format(bending=4e-3), encoding="utf-8")
    (folder / "guess.toml").write_text(POSTURE.format(bending=1e-2), encoding="utf-8")
    shape = json.loads(_cablecosim("shape", str(folder / "truth.toml")).stdout)
    nodes = 1e3 * np.array(shape["nodes"])[2:-2:2]
    nodes += 0.2 * np.random.default_rng(1).normal(size=nodes.shape)
    lines = "\n".join(",".join(f"{value:.3f}" for value in row) for row in nodes)
    (folder / "points.csv").write_text(f"x [mm], y [mm], z [mm]\n{lines}\n", encoding="utf-8")
    return folder


@pytest.mark.thorough
def test_a_stiffness_is_fitted_and_written(folder: Path) -> None:
    ended = _cablecosim("calibrate", str(folder / "points.csv"), str(folder / "guess.toml"), "--json", str(folder / "out.json"))
    assert ended.returncode == 0, ended.stderr
    assert "95% interval" in ended.stdout
    assert "calibrate: bounding what the points leave open" in ended.stderr
    fitted = json.loads((folder / "out.json").read_text(encoding="utf-8"))["numbers"]["bending"]
    assert fitted["low"] < 4e-3 < fitted["high"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("absent.csv", "guess.toml"), "absent.csv: cannot be read as comma-separated text: No such file or directory"),
        (("points.csv", "guess.toml", "--json", "absent/out.json"), "there is no such folder; give a file in a folder that exists"),
        (("points.csv", "absent.toml"), "absent.toml"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_a_sentence(folder: Path, words: tuple[str, ...], sentence: str) -> None:
    ended = _cablecosim("calibrate", *(word if word.startswith("--") else str(folder / word) for word in words))
    assert ended.returncode == 2
    assert sentence in ended.stderr
    assert "Traceback" not in ended.stderr
