"""Viewers that are slow, leave and come back: no step is slower for them, and no recorded frame is lost."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from programs import SCENE, Box, recorded, remote

from protocol import recording
from protocol.channel import Subscriber
from protocol.messages import StartRun

ROPE = SCENE.with_name("rope.toml")
SLOW = 0.1  # s a frame; a step of the rope takes less than a thousandth of a second
SETTINGS = ["time_step=0.006"]  # 500 steps


class Crowd:
    """Two slow viewers on each stream, and one on each that leaves and comes back all the time; use in a `with` statement."""

    def __init__(self, box: Box) -> None:
        self._over = threading.Event()
        where = [(box.at("frames"), False), (box.at("live"), True)]
        self._threads = [threading.Thread(target=look, args=one) for one in where * 2 for look in (self._look_slowly,)]
        self._threads += [threading.Thread(target=self._come_and_go, args=one) for one in where]
        self.seen = 0

    def __enter__(self) -> Crowd:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _look_slowly(self, address: str, latest_only: bool) -> None:
        with closing(Subscriber(address, latest_only=latest_only)) as stream:
            while not self._over.wait(SLOW):
                self.seen += stream.receive(0.0) is not None

    def _come_and_go(self, address: str, latest_only: bool) -> None:
        while not self._over.is_set():
            with closing(Subscriber(address, latest_only=latest_only)) as stream:
                stream.receive(SLOW)


def run(box: Box, shape: str, out: Path) -> np.ndarray:
    """Record a run; the seconds that each step took, (steps,)."""
    env, viz = box.env_server(shape, scene=ROPE, settings=SETTINGS), box.viz_client(out)
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun(recorders=1))
        assert viz.wait() == 0
    assert env.wait() == 0
    frames = recording.read(out / recording.FILE_NAME).frames
    return np.array([frame.bill.total for frame in frames])


@pytest.mark.thorough
def test_slow_and_fickle_viewers_lose_nobody_a_recorded_frame(box: Box, shape: str, tmp_path: Path) -> None:
    run(box, shape, tmp_path / "alone")
    with Crowd(box) as crowd:
        run(box, shape, tmp_path / "watched")
    assert crowd.seen > 0
    assert recorded(tmp_path / "watched") == recorded(tmp_path / "alone")


@pytest.mark.slow
def test_slow_and_fickle_viewers_slow_no_step_by_more_than_a_tenth(box: Box, shape: str, tmp_path: Path) -> None:
    """The least of five for each step, the two cases in turn, for other work on the machine is not meant."""
    alone, watched = [], []
    for number in range(5):
        alone.append(run(box, shape, tmp_path / f"alone {number}"))
        with Crowd(box):
            watched.append(run(box, shape, tmp_path / f"watched {number}"))
    ratio = np.median(np.min(watched, axis=0)[1:]) / np.median(np.min(alone, axis=0)[1:])
    assert ratio < 1.10  # the crowd's own work included
