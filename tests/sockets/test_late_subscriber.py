"""Whoever joins late sees what the scene looks like and all that comes from then on; nobody waits for a viewer."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from programs import LIMIT, STEPS, Box, plain, recorded, remote, until

from protocol import recording
from protocol.channel import Subscriber
from protocol.codec import decode
from protocol.messages import Done, Finished, Frame, Resume, StartRun


@pytest.mark.thorough
def test_a_recorder_that_joins_in_the_middle_gets_the_snapshot_and_every_later_frame(box: Box, shape: str, tmp_path: Path) -> None:
    env = box.env_server(shape)
    early = Subscriber(box.at("frames"))
    with remote(box) as control:
        control.start_held(recorders=1)
        paused = control.hold_after(5)
        late = box.viz_client(tmp_path)
        file = tmp_path / recording.FILE_NAME
        until(lambda: (file.is_file() and file.stat().st_size > 0) or None)  # the stream is joined before the snapshot is asked for
        time.sleep(0.5)
        assert control.state().step == paused
        assert isinstance(control.tell(Resume()), Done)
        assert late.wait() == 0
    early.close()
    assert env.wait() == 0
    messages = recorded(tmp_path)
    sequences = [message["sequence"] for message in messages[1:-1]]
    assert (messages[0]["type"], messages[-1]["type"]) == ("Snapshot", "Finished")
    assert sequences == list(range(sequences[0], STEPS + 1))
    assert sequences[0] == paused + 1
    assert plain(file)[1]["bill"]["wait"] > 0.5  # the pause stands in the bill of the step that it held up
    assert "joined late" in late.words


@pytest.mark.thorough
def test_a_viewer_that_never_reads_holds_nothing_up_and_loses_nothing(box: Box, shape: str) -> None:
    env = box.env_server(shape)
    lazy = Subscriber(box.at("frames"))
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun(recorders=1))
        assert control.wait_for("finished", "failed").state == "finished"
        messages = [decode(lazy.receive(LIMIT) or b"") for _ in range(STEPS + 2)]
    lazy.close()
    assert env.wait() == 0
    frames = messages[:-1]
    assert all(isinstance(frame, Frame) and frame.sequence == place and frame.bill.wait == 0 for place, frame in enumerate(frames))
    assert isinstance(messages[-1], Finished)


@pytest.mark.thorough
def test_live_viewing_shows_the_newest_frame_only(box: Box, shape: str) -> None:
    env = box.env_server(shape)
    live = Subscriber(box.at("live"), latest_only=True)
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun())
        control.wait_for("finished")
        assert isinstance(until(lambda: decode(live.receive(LIMIT) or b"")), Finished)
        assert live.receive(0.2) is None
    live.close()
    assert env.wait() == 0
