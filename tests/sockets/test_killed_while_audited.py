"""Programs killed while left-out effects are audited: the recording, with what the audits found, is as of an undisturbed run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from programs import ROOT, recorded
from test_killed_at_any_point import SILENCE, Notes

import scenarios
from protocol import recording
from scenarios.launch import launch

SCENE = Path(__file__).parent / "scenes" / "audited.toml"
# In one stretch of ten steps and the next: what is asked counts from the start of the next stretch on.
ENVIRONMENT = ("frame before 9", "ask after 8", "hear before 7", "checkpoint after 6", "report after 14")
AUDITOR = ("receive before 2", "answer before 1", "reply before 3")


def run(folder: Path) -> Notes:
    notes = Notes()
    ended = launch(scenarios.load(str(SCENE)), "audited", notes, out=folder, kernels="compiled", replay=False, silence=SILENCE)
    assert ended.summary["complete"]
    return notes


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    assert run(folder).restarts == []
    audits = [one for frame in recording.read(folder / recording.FILE_NAME).frames for one in frame.audits]
    assert len(audits) >= 6  # two effects in at least three stretches
    assert all(one.actual is not None and not one.is_broken for one in audits)
    return folder


@pytest.mark.slow
def test_a_run_that_is_killed_while_it_is_audited_is_as_an_undisturbed_one(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check(tmp_path, undisturbed, monkeypatch, "env_server", ENVIRONMENT[:2])


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("program", "points"), [("env_server", ENVIRONMENT), ("auditor", AUDITOR)], ids=["environment", "auditor"])
def test_a_run_that_is_killed_at_every_point_while_it_is_audited_is_as_an_undisturbed_one(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch, program: str, points: tuple[str, ...]
) -> None:
    check(tmp_path, undisturbed, monkeypatch, program, points)


def check(folder: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch, program: str, points: tuple[str, ...]) -> None:
    (folder / "auditor").mkdir()
    place = folder if program == "env_server" else folder / "auditor"
    module = "env_server" if program == "env_server" else "shape_server"
    file = place / f"{module}.points"
    file.write_text("\n".join(f"{line} SIGKILL" for line in points), encoding="utf-8")
    faulty = str(ROOT / "tests" / "sockets" / "faulty.py")

    def command(name: str, arguments: tuple[str, ...]) -> list[str]:
        own = folder / "auditor" if "--gives-way" in arguments else folder
        return [sys.executable, "-P", faulty, str(own), name, *arguments]

    monkeypatch.setattr("scenarios.children.command", command)
    notes = run(folder / "run")
    assert file.read_text(encoding="utf-8") == ""
    assert sum(line.startswith(program) for line in notes.restarts) >= len(points)
    assert recorded(folder / "run") == recorded(undisturbed)
