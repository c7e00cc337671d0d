"""A disk that takes no more: the run ends with a sentence, and what is recorded stays readable."""

from __future__ import annotations

import re
import resource
from collections.abc import Sequence
from pathlib import Path

import pytest
from programs import SCENE, STEPS, Box, recorded, remote, until

import scenarios
from protocol import recording
from protocol.errors import CablecosimError
from protocol.messages import Resume
from scenarios.children import Child
from scenarios.launch import launch
from scenarios.progress import display

ROOM = 150_000  # bytes; a frame has about 8000


def limit(pid: int) -> None:
    """Let a process write no file larger than ROOM, which it meets as it would meet a full disk: an error of the write."""
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (ROOM, ROOM))


@pytest.mark.thorough
def test_a_recorder_whose_disk_is_full_says_so_and_its_recording_is_readable(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    with remote(box) as control:
        viz = box.viz_client(tmp_path)
        control.start_held(recorders=1)
        limit(viz.process.pid)
        control.tell(Resume())
        assert viz.wait() == 2
        assert f"viz_client: recording {tmp_path / recording.FILE_NAME} cannot be continued: File too large" in viz.words
        assert control.wait_for("finished").step == STEPS  # the environment is not held up
    assert env.wait() == 0
    read = recording.read(tmp_path / recording.FILE_NAME)
    assert 5 < len(read.frames) < STEPS
    assert [frame.sequence for frame in read.frames] == list(range(len(read.frames)))
    assert "bytes of an unfinished message follow" in read.ending


@pytest.mark.thorough
def test_a_journal_whose_disk_is_full_ends_the_run_in_good_order(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape, "--journal", str(tmp_path / "journal"))
    with remote(box) as control:
        viz = box.viz_client(tmp_path)
        control.start_held(recorders=1)
        limit(env.process.pid)
        control.tell(Resume())
        assert viz.wait() == 0
        assert "cannot be continued: File too large" in control.wait_for("failed").sentence
    assert env.wait() == 1
    messages = recorded(tmp_path)
    assert messages[-1]["failed"]
    assert messages[-1]["frames"] == len(messages) - 2 > 5
    assert len(recording.read(tmp_path / "journal" / "frames.msgpack").frames) == len(messages) - 2


@pytest.mark.thorough
def test_a_run_whose_disk_is_full_ends_with_the_sentence_and_keeps_what_it_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def child(name: str, arguments: Sequence[str], log: Path, program: str) -> Child:
        made = Child(name, arguments, log, program)
        if name == "viz_client":
            limit(made.pid)
        return made

    monkeypatch.setattr("scenarios.keeper.Child", child)
    with pytest.raises(CablecosimError, match=r"recording .* cannot be continued: File too large\nthe first \d+ steps are in"):
        launch(scenarios.load(str(SCENE)), "box", display(), out=tmp_path / "run", kernels="compiled", replay=False)
    assert len(recording.read(tmp_path / "run" / recording.FILE_NAME).frames) > 5


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["shape_server", "env_server"])
def test_a_second_program_on_the_same_address_is_refused_and_the_first_goes_on(box: Box, shape: str, name: str) -> None:
    first = box.shape_server() if name == "shape_server" else box.env_server(shape)
    address = box.at("shape" if name == "shape_server" else "control")
    until(lambda: address in first.words or None)
    second = box.shape_server() if name == "shape_server" else box.env_server(shape)
    assert second.wait() == 2
    assert re.fullmatch(rf"{name}: address '\S+': another program answers there; give another address, or end that program\n", second.words)
    assert first.process.poll() is None
