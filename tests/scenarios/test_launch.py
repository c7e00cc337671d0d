"""The launcher with three stand-ins for the programs: good runs, and everything that may go wrong around one."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from recordings import SCENE

from protocol import recording
from protocol.errors import CablecosimError, PeerLostError, SceneError
from scenarios.children import Child
from scenarios.launch import launch
from scenarios.progress import Lines, display

STAND_INS = Path(__file__).with_name("stand_ins.py")


class Notes:
    """A display that remembers; interrupts the run at a step if told to."""

    def __init__(self, interrupt: int | None = None) -> None:
        self.lines: list[str] = []
        self.steps: list[tuple[int, int, int]] = []
        self.interrupt = interrupt

    def say(self, sentence: str) -> None:
        self.lines.append(sentence)

    def step(self, step: int, steps: int, contacts: int) -> None:
        self.steps.append((step, steps, contacts))
        if self.interrupt is not None and step >= self.interrupt:
            self.interrupt = None
            raise KeyboardInterrupt

    def close(self) -> None:
        self.lines.append("closed")


class Stage:
    """The programs that a test starts, each with its behaviour."""

    def __init__(self) -> None:
        self.behaviour: dict[str, str] = {}
        self.children: list[Child] = []
        self.boxes: list[Path] = []

    def command(self, name: str, arguments: Sequence[str]) -> list[str]:
        return [sys.executable, str(STAND_INS), self.behaviour.get(name, "well"), name, *arguments]

    def child(self, name: str, arguments: Sequence[str], log: Path, program: str) -> Child:
        self.children.append(Child(name, arguments, log, program))
        self.boxes.append(log.parent)
        return self.children[-1]


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Stage]:
    stage = Stage()
    monkeypatch.setattr("scenarios.children.command", stage.command)
    monkeypatch.setattr("scenarios.keeper.Child", stage.child)
    monkeypatch.chdir(tmp_path)
    yield stage
    assert all(child.code is not None for child in stage.children), "a program was left running"
    assert not any(box.exists() for box in stage.boxes), "the temporary directory was left behind"


@pytest.mark.parametrize("behaviour", ["well", "leave"])
def test_a_run_leaves_a_recording_a_summary_and_the_logs(stage: Stage, tmp_path: Path, behaviour: str) -> None:
    stage.behaviour["env_server"] = behaviour
    notes = Notes()

    ended = launch(SCENE, "small", notes)

    assert ended.folder.parent == Path("runs")
    assert ended.folder.name.startswith("small-20")
    assert sorted(path.name for path in ended.folder.iterdir()) == ["logs", recording.FILE_NAME, "summary.json"]
    assert sorted(path.name for path in (ended.folder / "logs").iterdir()) == ["env_server.log", "shape_server.log", "viz_client.log"]
    written = json.loads((ended.folder / "summary.json").read_text())
    assert written == ended.summary
    assert (written["complete"], written["steps"], written["contacts_max"]) == (True, 20, 20)
    assert written["wall_s"] > 0.3
    assert "starting, once" in notes.lines
    assert notes.lines[-1] == "closed"
    assert [child.code for child in stage.children] == [0, 0, 0]


def test_the_run_folder_may_be_chosen(stage: Stage, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()

    assert launch(SCENE, "small", Notes(), out=tmp_path / "mine").folder == tmp_path / "mine"


@pytest.mark.parametrize(
    ("behaviour", "kind", "sentence"),
    [
        ("fail", SceneError, "the left arm cannot reach its grasp"),
        ("refuse", CablecosimError, "bodies[0].mesh: no triangle in it; give a mesh of triangles"),
        ("segfault", PeerLostError, "env_server was killed by signal 11 (SIGSEGV, a segmentation fault); it printed nothing"),
    ],
)
def test_a_scene_that_cannot_begin_leaves_nothing_behind(
    behaviour: str, kind: type[Exception], sentence: str, stage: Stage, tmp_path: Path
) -> None:
    stage.behaviour["env_server"] = behaviour

    with pytest.raises(kind) as caught:
        launch(SCENE, "small", Notes())

    assert str(caught.value) == sentence
    assert list(tmp_path.iterdir()) == []


def test_a_shape_server_that_dies_at_the_start_is_noticed_while_the_environment_waits_for_it(stage: Stage, tmp_path: Path) -> None:
    stage.behaviour |= {"shape_server": "die", "env_server": "wait"}

    with pytest.raises(PeerLostError, match="shape_server ended with exit code 7; its last lines were:\n    no kernels"):
        launch(SCENE, "small", Notes())

    assert list(tmp_path.iterdir()) == []


def test_an_environment_that_dies_is_named_with_its_last_words_and_what_it_did_is_kept(stage: Stage) -> None:
    stage.behaviour["env_server"] = "die"
    stage.behaviour["viz_client"] = "well"

    with pytest.raises(PeerLostError) as caught:
        launch(SCENE, "small", Notes())

    (folder,) = Path("runs").iterdir()
    assert str(caught.value).startswith(
        "env_server ended with exit code 7; its last lines were:\n    the arm fell off\nthe first 5 steps are in "
    )
    assert (folder / "logs" / "env_server.log").read_text() == "the arm fell off\n"
    assert not json.loads((folder / "summary.json").read_text())["complete"]


@pytest.mark.thorough
def test_a_recorder_that_is_killed_again_and_again_is_named_with_the_signal(stage: Stage) -> None:
    stage.behaviour |= {"viz_client": "die", "env_server": "slow"}
    notes = Notes()

    with pytest.raises(PeerLostError, match=r"viz_client was killed by signal 9 \(SIGKILL\), after it had been started again 3 times"):
        launch(SCENE, "small", notes)

    assert notes.lines.count("viz_client was killed by signal 9 (SIGKILL); it is started again") == 3


def test_an_interrupted_run_ends_in_good_order_with_its_recording_whole(stage: Stage) -> None:
    stage.behaviour["env_server"] = "slow"

    ended = launch(SCENE, "small", Notes(interrupt=2))

    assert ended.interrupted
    run = recording.read(ended.folder / recording.FILE_NAME)
    assert run.finished is not None
    assert run.finished.sentence == "stopped"
    assert 2 <= ended.summary["steps"] < 20
    assert [child.code for child in stage.children] == [0, 0, 0]


def test_without_a_terminal_progress_is_a_few_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    shown = display()
    assert isinstance(shown, Lines)
    for step in range(101):
        shown.step(step, 100, 1)
        shown.say("compiling")
    shown.close()

    lines = capsys.readouterr().err.splitlines()
    assert len([line for line in lines if line.startswith("step")]) == 11
    assert lines[0].startswith("step 0 of 100, 1 contact")
