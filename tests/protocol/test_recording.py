"""A recording is the bytes of the wire, one message after another, readable whatever happened to its writer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgpack
import numpy as np
import pytest

from protocol import recording
from protocol.codec import encode
from protocol.errors import RecordingError
from protocol.messages import Bill, Finished, Frame, Snapshot, Solid, Stop, TouchPoints
from protocol.scene import Cable, Gripper, Scene

CABLE = Cable(name="wire", length=1.0, diameter=0.006, mass_per_length=0.02)
HAND = Gripper(name="hand", cable="wire", at=0.0, position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0))
TRIANGLE = Solid(name="plate", vertices=np.eye(3), triangles=np.array([[0, 1, 2]]), color=(0.5, 0.5, 0.5))
NOTHING = TouchPoints(cable=np.zeros(0, int), body=np.zeros(0, int), s=np.zeros(0), point=np.zeros((0, 3)), force=np.zeros((0, 3)))
BILL = Bill(**dict.fromkeys(Bill.__struct_fields__, 0.0))
SNAPSHOT = encode(
    Snapshot(
        session="run", scene=Scene(title="wire", cables=(CABLE,), grippers=(HAND,)), solids=(TRIANGLE,), joints=(), steps=3, versions={}
    )
)
FINISHED = encode(Finished(session="run", frames=3, failed=False, sentence="done"))

WRITE_UNTIL_KILLED = """
import sys
from pathlib import Path
from protocol import recording
snapshot, frame = (Path(name).read_bytes() for name in sys.argv[2:])
writer = recording.Writer(Path(sys.argv[1]))
writer.write(snapshot)
while True:
    writer.write(frame)
    sys.stdout.write("x")
    sys.stdout.flush()
"""


def frame(sequence: int) -> bytes:
    poses = np.array([[0.1 * sequence, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    numbers = {"time": 0.02 * sequence, "rounds": 1, "penetration": 0.0, "grasp_error": 0.0, "torque_ratio": 0.0}
    parts = {"joints": np.zeros(0), "poses": poses, "grasps": (), "shapes": (), "touching": NOTHING, "collisions": (), "bill": BILL}
    return encode(Frame(session="run", sequence=sequence, move="start", picture="", **numbers, **parts))


def write(path: Path, *messages: bytes) -> Path:
    with recording.Writer(path) as writer:
        for message in messages:
            writer.write(message)
    return path


def test_what_is_written_is_read_back(tmp_path):
    run = recording.read(write(tmp_path / "r", SNAPSHOT, frame(0), frame(1), frame(2), FINISHED))
    assert run.complete
    assert run.ending == ""
    assert run.snapshot.solids[0].name == "plate"
    assert [f.sequence for f in run.frames] == [0, 1, 2]
    assert [f.sequence for f in run.frames[1:]] == [1, 2]
    assert run.finished is not None
    assert run.finished.sentence == "done"


def test_the_file_is_the_bytes_of_the_wire_and_nothing_else(tmp_path):
    path = write(tmp_path / "r", SNAPSHOT, frame(0), FINISHED)
    assert path.read_bytes() == SNAPSHOT + frame(0) + FINISHED


def test_a_plain_messagepack_library_reads_it(tmp_path):
    path = write(tmp_path / "r", SNAPSHOT, frame(2), FINISHED)
    with path.open("rb") as file:
        snapshot, moved, finished = msgpack.Unpacker(file, max_buffer_size=0)
    assert (snapshot["type"], moved["type"], finished["type"]) == ("Snapshot", "Frame", "Finished")
    poses = moved["poses"]
    assert poses.keys() == {"dtype", "shape", "data"}
    assert np.frombuffer(poses["data"], poses["dtype"]).reshape(poses["shape"])[0, 0] == pytest.approx(0.2)


def test_a_file_cut_anywhere_in_its_last_message_reads_up_to_the_one_before(tmp_path):
    whole, last = SNAPSHOT + frame(0) + frame(1), frame(2)
    path = tmp_path / "r"
    for kept in range(len(last)):
        path.write_bytes(whole + last[:kept])
        run = recording.read(path)
        assert len(run.frames) == 2
        assert run.frames[1].sequence == 1
        assert not run.complete
        assert run.ending == f"after 2 frames, {f'{kept} bytes of an unfinished message follow' if kept else 'the run was not finished'}"


def test_a_file_cut_within_its_snapshot_cannot_be_read(tmp_path):
    path = tmp_path / "r"
    for kept in range(len(SNAPSHOT)):
        path.write_bytes(SNAPSHOT[:kept])
        with pytest.raises(RecordingError):
            recording.read(path)


@pytest.mark.parametrize("beginning", [b"hello, world", FINISHED, b"\xdf\xff\xff\xff\xff", b"\x81" * 5000, b"\x00"])
def test_what_is_no_recording_is_refused_with_a_sentence(tmp_path, beginning):
    (tmp_path / "r").write_bytes(beginning)
    with pytest.raises(RecordingError, match="does not begin with a snapshot"):
        recording.read(tmp_path / "r")


def test_a_missing_recording_is_refused_with_a_sentence(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read"):
        recording.read(tmp_path / "none")


def test_reading_stops_before_a_damaged_frame_and_says_so(tmp_path):
    run = recording.read(write(tmp_path / "r", SNAPSHOT, frame(0), msgpack.packb({"type": "Frame", "session": 3}), frame(1)))
    assert len(run.frames) == 1
    assert not run.complete
    assert run.ending.startswith("message 2 cannot be used: not a message of this protocol")


def test_reading_stops_before_a_message_that_belongs_elsewhere(tmp_path):
    run = recording.read(write(tmp_path / "r", SNAPSHOT, frame(0), encode(Stop()), frame(1)))
    assert len(run.frames) == 1
    assert run.ending == "message 2 cannot be used: a Stop does not belong there"


def test_a_recording_is_never_overwritten(tmp_path):
    path = write(tmp_path / "r", SNAPSHOT)
    with pytest.raises(RecordingError, match="never overwritten"):
        recording.Writer(path)
    assert path.read_bytes() == SNAPSHOT


def test_a_full_disk_is_reported_with_a_sentence(tmp_path, monkeypatch):
    writer = recording.Writer(tmp_path / "r")
    writer.write(SNAPSHOT)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(RecordingError, match="cannot be continued: No space left on device"):
        writer.write(frame(0))
    monkeypatch.undo()
    writer.close()
    assert len(recording.read(tmp_path / "r").frames) == 0


def test_a_killed_writer_loses_no_whole_message(tmp_path):
    (tmp_path / "snapshot").write_bytes(SNAPSHOT)
    (tmp_path / "frame").write_bytes(frame(7))
    names = [str(tmp_path / name) for name in ("r", "snapshot", "frame")]
    root = str(Path(__file__).parents[2])
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITE_UNTIL_KILLED, *names], stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": root}
    )
    assert writer.stdout is not None
    told = len(writer.stdout.read(50))
    writer.send_signal(signal.SIGKILL)
    told += len(writer.stdout.read())
    writer.stdout.close()
    assert writer.wait() == -signal.SIGKILL
    run = recording.read(tmp_path / "r")
    assert told <= len(run.frames) <= told + 1
    assert run.frames[told - 1].sequence == 7


def test_four_hundred_frames_are_read_quickly(tmp_path):
    large = Solid(name="robot", vertices=np.zeros((100_000, 3)), triangles=np.zeros((200_000, 3), int), color=(1.0, 1.0, 1.0))
    scene = Scene(title="wire", cables=(CABLE,), grippers=(HAND,))
    snapshot = encode(Snapshot(session="run", scene=scene, solids=(large,), joints=(), steps=400, versions={}))
    path = write(tmp_path / "r", snapshot, *(frame(i) for i in range(400)), FINISHED)
    begin = time.process_time()
    run = recording.read(path)
    assert len(run.frames) == 400
    assert time.process_time() - begin < 1.0  # measured 0.06 s for 16 MB
