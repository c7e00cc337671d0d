"""A program that is killed, stopped or never started: the others end by themselves with a sentence, or carry on."""

from __future__ import annotations

import signal
import time
from contextlib import closing
from pathlib import Path

import pytest
from programs import LIMIT, STEPS, Box, Program, Remote, recorded, remote, until

from protocol import recording
from protocol.channel import Subscriber
from protocol.codec import decode
from protocol.messages import Done, Finished, Frame, Resume, Stop


def started(box: Box, control: Remote, out: Path) -> Program:
    """A run that is held before its first step, and its recorder, which has the snapshot."""
    viz = box.viz_client(out)
    control.start_held(recorders=1)
    until(lambda: has_begun(out) or None)
    return viz


def has_begun(out: Path) -> bool:
    """Whether a recording holds something."""
    file = out / recording.FILE_NAME
    return file.is_file() and file.stat().st_size > 0


@pytest.mark.thorough
def test_a_shape_server_that_is_killed_and_started_again_costs_time_and_nothing_else(box: Box, tmp_path: Path) -> None:
    first, env = box.shape_server(), box.env_server()
    with remote(box) as control:
        viz = started(box, control, tmp_path / "disturbed")
        assert control.hold_after(3) < STEPS
        first.say(signal.SIGKILL)
        first.wait()
        control.tell(Resume())
        time.sleep(0.5)
        assert control.state().state == "running"
        box.shape_server()
        assert viz.wait() == 0
    assert env.wait() == 0
    env = box.env_server()
    with remote(box) as control:
        viz = started(box, control, tmp_path / "undisturbed")
        control.tell(Resume())
        assert viz.wait() == 0
    assert env.wait() == 0
    assert recorded(tmp_path / "disturbed") == recorded(tmp_path / "undisturbed")


def test_a_shape_server_that_is_killed_for_good_ends_the_run_with_a_sentence(box: Box, tmp_path: Path) -> None:
    shape, env = box.shape_server(), box.env_server(None, "--patience", "3")
    with remote(box) as control:
        viz = started(box, control, tmp_path)
        control.hold_after(3)
        shape.say(signal.SIGKILL)
        control.tell(Resume())
        state = control.wait_for("failed")
        assert f"the shape server at {box.at('shape')} has been silent for 3 s" in state.sentence
        assert viz.wait() == 0
    assert env.wait() == 1
    messages = recorded(tmp_path)
    assert messages[-1] == {
        "type": "Finished",
        "session": messages[0]["session"],
        "frames": len(messages) - 2,
        "failed": True,
        "sentence": state.sentence,
    }


@pytest.mark.thorough
def test_a_shape_server_that_never_comes_ends_the_environment_with_a_sentence_and_code_2(box: Box) -> None:
    env = box.env_server(None, "--patience", "3")
    assert env.wait() == 2
    assert f"env_server: no shape server at {box.at('shape')} within 3 s; start it with: python -m shape_server" in env.words
    assert "Traceback" not in env.words


@pytest.mark.thorough
def test_an_environment_that_is_killed_leaves_the_recorder_to_end_by_itself(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    with remote(box) as control:
        viz = started(box, control, tmp_path)
        step = control.hold_after(3)
        env.say(signal.SIGKILL)
        env.wait()
    assert viz.wait() == 1
    assert "the environment was silent for 5 s and did not answer within 5 s" in viz.words
    run = recording.read(tmp_path / recording.FILE_NAME)
    assert not run.complete
    assert [frame.sequence for frame in run.frames] == list(range(step + 1))


@pytest.mark.thorough
def test_a_run_that_is_stopped_ends_in_good_order_and_says_where(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    with remote(box) as control:
        viz = started(box, control, tmp_path)
        step = control.hold_after(3)
        assert isinstance(control.tell(Stop()), Done)
        assert viz.wait() == 0
        assert env.wait() == 0
    run = recording.read(tmp_path / recording.FILE_NAME)
    assert [frame.sequence for frame in run.frames] == list(range(step + 1))
    assert run.finished is not None
    assert run.finished.failed
    assert run.finished.sentence == f"stopped before step {step + 1} of {STEPS}"


@pytest.mark.thorough
def test_a_recorder_that_is_killed_holds_nothing_up(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    with remote(box) as control, closing(Subscriber(box.at("frames"))) as other:
        viz = box.viz_client(tmp_path)
        control.start_held(recorders=2)
        step = control.hold_after(3)
        until(lambda: has_begun(tmp_path) or None)
        viz.say(signal.SIGKILL)
        viz.wait()
        control.tell(Resume())
        messages = []
        while not messages or not isinstance(messages[-1], Finished):
            messages.append(decode(other.receive(LIMIT) or b""))
    assert env.wait() == 0
    assert [frame.sequence for frame in messages[:-1] if isinstance(frame, Frame)] == list(range(STEPS + 1))
    assert len(recording.read(tmp_path / recording.FILE_NAME).frames) <= step + 1


@pytest.mark.thorough
def test_a_recorder_that_is_held_up_loses_nothing(box: Box, shape: str, tmp_path: Path) -> None:
    """Longer than the heartbeats of ZeroMQ would wait, which drop what is queued when they give up."""
    env = box.env_server(shape)
    with remote(box) as control:
        viz = started(box, control, tmp_path)
        control.hold_after(3)
        viz.say(signal.SIGSTOP)
        control.tell(Resume())
        control.wait_for("finished")
        time.sleep(2.5)
        viz.say(signal.SIGCONT)
        assert viz.wait() == 0
    assert env.wait() == 0
    assert [message["sequence"] for message in recorded(tmp_path)[1:-1]] == list(range(STEPS + 1))


@pytest.mark.thorough
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_shape_server_that_is_told_to_end_by_a_signal_while_it_solves_ends_in_good_order(
    box: Box, tmp_path: Path, number: signal.Signals
) -> None:
    """What a handler of signals raises within a call of numba's crashes the process; one time in a few, when it solves without a pause."""
    server = box.shape_server()
    box.env_server()
    with remote(box) as control:
        started(box, control, tmp_path)
        control.tell(Resume())
        server.say(number)
        assert server.wait() == 0
        control.tell(Stop())


@pytest.mark.thorough
def test_a_terminated_environment_ends_its_run_in_good_order(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    with remote(box) as control:
        viz = started(box, control, tmp_path)
        control.hold_after(3)
        env.say(signal.SIGTERM)
        assert env.wait() == 0
        assert viz.wait() == 0
    assert recorded(tmp_path)[-1]["sentence"].startswith("stopped before step")
