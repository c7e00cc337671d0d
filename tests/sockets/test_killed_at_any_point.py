"""Each program killed and stopped at each point of a step and started again by the launcher: the recording is as of an undisturbed run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from programs import ROOT, SCENE, STEPS, recorded

import scenarios
from protocol import recording
from protocol.errors import PeerLostError
from scenarios.launch import Ended, launch

SILENCE = 6.0  # s; a busy machine may hold a healthy program up for two
ENVIRONMENT = (
    "ask before 3", "ask after 9", "hear before 4", "hear after 10", "robot after 6", "search after 12", "frame before 5", "frame after 5",
    "checkpoint after 4", "store halfway 5", "publish before 7", "publish after 7", "report after 6",
)  # fmt: skip
SHAPE_SERVER = ("receive after 6", "answer before 4", "answer after 5", "reply before 3")
RECORDER_AT_FIRST = ("record before 1", "record halfway 1", "record after 1")
RECORDER = ("take after 8", "record before 5", "record halfway 7", "record after 4")
DEFAULT = {"env_server": ENVIRONMENT[7:10], "shape_server": SHAPE_SERVER[1:2], "viz_client": RECORDER[2:3]}


class Notes:
    """A display that remembers."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, sentence: str) -> None:
        self.lines.append(sentence)

    def step(self, step: int, steps: int, contacts: int) -> None:
        pass

    def close(self) -> None:
        pass

    @property
    def restarts(self) -> list[str]:
        return [line for line in self.lines if line.endswith("it is started again")]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run to which nothing happened."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    notes = Notes()
    assert run(folder, notes).summary["complete"]
    assert notes.restarts == []
    return folder


def run(folder: Path, notes: Notes) -> Ended:
    """The scene of these tests, from the launcher."""
    return launch(scenarios.load(str(SCENE)), "box", notes, out=folder, kernels="compiled", replay=False, silence=SILENCE)


def spoiled(folder: Path, points: dict[str, Sequence[str]], number: str, monkeypatch: pytest.MonkeyPatch) -> Notes:
    """A run in which programs fail at these points, one after another."""
    for program, lines in points.items():
        (folder / f"{program}.points").write_text("\n".join(f"{line} {number}" for line in lines), encoding="utf-8")
    faulty = str(ROOT / "tests" / "sockets" / "faulty.py")
    monkeypatch.setattr("scenarios.children.command", lambda name, arguments: [sys.executable, "-P", faulty, str(folder), name, *arguments])
    notes = Notes()
    run(folder / "run", notes)
    return notes


def check(folder: Path, undisturbed: Path, notes: Notes, faults: int) -> None:
    """Every fault came, and nothing came of it."""
    assert len(notes.restarts) >= faults  # one more if the machine is so busy that a healthy program seems to hang
    assert [path.read_text(encoding="utf-8") for path in folder.glob("*.points")] == [""] * len(list(folder.glob("*.points")))
    first, second = recorded(undisturbed), recorded(folder / "run")
    assert len(second) == STEPS + 3
    assert second == first
    assert sorted(path.name for path in (folder / "run").iterdir()) == ["logs", "pictures", recording.FILE_NAME, "summary.json"]
    assert sorted(path.name for path in (folder / "run" / "pictures").iterdir()) == ["01_above.png", "02_on_the_box.png"]


@pytest.mark.thorough
def test_programs_killed_one_after_another_leave_the_recording_of_an_undisturbed_run(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = spoiled(tmp_path, DEFAULT, "SIGKILL", monkeypatch)
    check(tmp_path, undisturbed, notes, 5)
    assert {line.partition(" ")[0] for line in notes.restarts} == {"env_server", "shape_server", "viz_client"}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("number", ["SIGKILL", "SIGSTOP"])
@pytest.mark.parametrize(
    ("program", "points"),
    [("env_server", ENVIRONMENT), ("shape_server", SHAPE_SERVER), ("viz_client", RECORDER_AT_FIRST), ("viz_client", RECORDER)],
    ids=["environment", "shape server", "recorder at first", "recorder"],
)
def test_a_program_that_fails_at_every_point_in_turn_costs_time_and_nothing_else(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch, program: str, points: tuple[str, ...], number: str
) -> None:
    notes = spoiled(tmp_path, {program: points}, number, monkeypatch)
    check(tmp_path, undisturbed, notes, len(points))
    words = f"{program} was killed by signal 9 (SIGKILL)" if number == "SIGKILL" else program
    assert sum(line.startswith(words) for line in notes.restarts) >= len(points)


@pytest.mark.slow
def test_a_program_that_is_killed_again_and_again_ends_the_run_with_a_sentence_and_a_readable_recording(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(PeerLostError) as caught:
        spoiled(tmp_path, {"env_server": ("frame before 9", *4 * ["ask before 1"])}, "SIGKILL", monkeypatch)
    assert str(caught.value).startswith("env_server was killed by signal 9 (SIGKILL), after it had been started again 3 times without")
    read = recording.read(tmp_path / "run" / recording.FILE_NAME)
    assert not read.complete
    assert recorded(tmp_path / "run") == recorded(undisturbed)[: len(read.frames) + 1]
    assert len(read.frames) == 7  # all that was published
