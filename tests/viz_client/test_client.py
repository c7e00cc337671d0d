from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from PIL import Image
from stand_in import StandIn
from synthetic import FINISHED, SNAPSHOT, frame, frames, write_run

from protocol import recording
from protocol.address import private_directory
from protocol.codec import encode
from protocol.errors import PeerLostError, RecordingError
from protocol.messages import Finished, Stop
from viz_client import client
from viz_client.client import watch
from viz_client.redraw import redraw

ROOT = Path(__file__).parents[2]


@pytest.fixture
def box():
    return private_directory()  # tmp_path can be too long for an ipc address


@pytest.fixture
def short_waits(monkeypatch):
    monkeypatch.setattr(client, "SILENCE", 0.2)
    monkeypatch.setattr(client, "ANSWER_LIMIT", 0.2)


def record(environment: StandIn, out: Path, **others):
    return watch(environment.frames, environment.control, out, **{"replay": False, "pictures": False, **others})


def start_program(*arguments: str) -> subprocess.Popen:
    command = [sys.executable, "-P", "-m", "viz_client", *arguments]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd="/"
    )


def test_the_recording_is_the_snapshot_and_then_the_very_bytes_of_the_stream(box, tmp_path):
    sent = [encode(message) for message in (*frames(), FINISHED)]
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(*sent)
        watched = record(environment, tmp_path / "run")
    assert watched == client.Watched(frames=11, missing=0, complete=True, sentence="done")
    assert (tmp_path / "run" / recording.FILE_NAME).read_bytes() == encode(SNAPSHOT) + b"".join(sent)


def test_who_joins_late_starts_with_the_next_frame_and_counts_what_is_missing(box, tmp_path):
    lines = []
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(*(frame(i) for i in (4, 5, 8)), Finished(session="run", frames=10, failed=False, sentence="done"))
        watched = record(environment, tmp_path, say=lines.append)
    assert (watched.frames, watched.missing, watched.complete) == (3, 4 + 2 + 1, True)
    assert "frames 0 to 3 are missing: joined late" in lines
    assert "frames 6 to 7 are missing" in lines
    assert [f.sequence for f in recording.read(tmp_path / recording.FILE_NAME).frames] == [4, 5, 8]


def test_an_environment_that_falls_silent_leaves_a_readable_recording(box, tmp_path, short_waits):
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(*frames(3), then=lambda: environment.asked.wait(10) and setattr(environment, "mute", True))
        watched = record(environment, tmp_path, replay=True)
    assert (watched.frames, watched.complete) == (3, False)
    assert "did not answer" in watched.sentence
    assert len(recording.read(tmp_path / recording.FILE_NAME).frames) == 3
    assert (tmp_path / "replay.html").exists()


def test_an_environment_that_is_only_slow_is_waited_for(box, tmp_path, short_waits):
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(frame(0), then=lambda: (time.sleep(0.8), environment.send(FINISHED)))
        assert record(environment, tmp_path).complete


def test_a_run_that_was_over_before_joining_ends_at_once(box, tmp_path, short_waits):
    with StandIn(box, SNAPSHOT, state="finished") as environment:
        watched = record(environment, tmp_path)
    assert (watched.frames, watched.missing, watched.complete) == (0, 1, False)
    assert "the run is over" in watched.sentence


def test_nobody_there_is_reported(box, tmp_path, monkeypatch):
    monkeypatch.setattr(client, "START_LIMIT", 0.5)
    with pytest.raises(PeerLostError, match="no snapshot from ipc"):
        watch(f"ipc://{box}/frames", f"ipc://{box}/control", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_environment_that_ends_before_the_snapshot_is_not_waited_for(box, tmp_path, monkeypatch):
    monkeypatch.setattr(client, "GONE_LIMIT", 0.2)
    monkeypatch.setattr(client, "ANSWER_LIMIT", 0.2)
    with StandIn(box, None) as environment:
        threading.Timer(0.3, lambda: setattr(environment, "mute", True)).start()
        with pytest.raises(PeerLostError, match="ended before the run began"):
            record(environment, tmp_path)


def test_a_scene_that_is_not_ready_is_waited_for(box, tmp_path):
    with StandIn(box, None) as environment:
        threading.Timer(0.3, lambda: setattr(environment, "snapshot", SNAPSHOT)).start()
        environment.send_later(*frames(), FINISHED)
        assert record(environment, tmp_path).frames == 11


def test_what_is_no_frame_is_left_out_and_reported(box, tmp_path):
    lines = []
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(b"\xc1rubbish", Stop(), *frames(), FINISHED)
        watched = record(environment, tmp_path, say=lines.append)
    assert watched.frames == 11
    assert sum("not recorded" in line for line in lines) == 2
    assert recording.read(tmp_path / recording.FILE_NAME).complete


def test_another_run_at_the_same_address_ends_the_recording(box, tmp_path):
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(frame(0), frame(0, session="next"))
        watched = record(environment, tmp_path)
    assert watched.sentence == "another run began at this address"
    assert len(recording.read(tmp_path / recording.FILE_NAME).frames) == 1


def test_a_folder_with_a_recording_is_refused(box, tmp_path):
    before = write_run(tmp_path).read_bytes()
    with StandIn(box, SNAPSHOT) as environment, pytest.raises(RecordingError, match="never overwritten"):
        record(environment, tmp_path)
    assert (tmp_path / recording.FILE_NAME).read_bytes() == before


@pytest.mark.thorough
def test_key_postures_are_drawn_while_recording_goes_on(box, tmp_path):
    lines = []
    with StandIn(box, SNAPSHOT) as environment:
        environment.send_later(*frames(), FINISHED)
        record(environment, tmp_path, pictures=True, say=lines.append)
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == ["01_begin.png", "02_laid_down.png"]
    with Image.open(tmp_path / "pictures" / "02_laid_down.png") as picture:
        assert picture.size == (1280, 800)
    words = [line.split(" after ")[0].split(" in ")[0] for line in lines]
    assert words == ["snapshot", "first frame", "recorded 11 frames", "first picture"]  # nobody waits for the drawing process to start


@pytest.mark.thorough
def test_pictures_and_page_are_made_anew_from_the_recording_alone(tmp_path):
    write_run(tmp_path, finished=False)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "07_old.png").write_bytes(b"old")
    lines = []
    redraw(tmp_path, say=lines.append)
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == ["01_begin.png", "02_laid_down.png"]
    assert (tmp_path / "replay.html").stat().st_size > 100_000
    assert lines[0] == "recording of 11 frames, after 11 frames, the run was not finished"


def test_a_signal_ends_the_program_in_good_order(box, tmp_path):
    with StandIn(box, SNAPSHOT) as environment:
        program = start_program("--frames", environment.frames, "--control", environment.control, "--out", str(tmp_path / "run"))
        environment.send(*frames(5))
        assert program.stdout is not None
        while "first frame" not in program.stdout.readline():
            pass
        program.send_signal(signal.SIGTERM)
        out, err = program.communicate(timeout=10)
    assert (program.returncode, err) == (0, "")
    assert "told to stop" in out
    assert len(recording.read(tmp_path / "run" / recording.FILE_NAME).frames) >= 1


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "viz_client: --frames, --control, --out missing; give --frames, --control and --out, or --redraw alone; see --help"),
        (("--frames", "ipc:///tmp/x", "--control", "http://there", "--out", "/tmp/x"), "viz_client: address 'http://there': must be"),
        (("--redraw", "/nowhere"), "viz_client: recording /nowhere/recording.msgpack cannot be read"),
        (("--redraw", "/nowhere", "--out", "/tmp/x"), "viz_client: --redraw does not go with --out; see --help"),
        (("--colour", "red"), "viz_client: unrecognized arguments: --colour red; see --help"),
    ],
)
def test_a_wrong_command_line_ends_with_code_2_and_one_sentence(arguments, sentence):
    program = start_program(*arguments)
    out, err = program.communicate(timeout=20)
    assert (program.returncode, out) == (2, "")
    assert err.startswith(sentence)
    assert err.count("\n") == 1


def test_help_says_what_is_written_and_how_it_ends():
    out, _ = start_program("--help").communicate(timeout=20)
    for word in ("recording.msgpack", "replay.html", "exit codes", "--no-pictures", "tcp://127.0.0.1:PORT"):
        assert word in out
