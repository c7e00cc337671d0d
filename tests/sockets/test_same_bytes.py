"""The same scene gives the same recording, byte for byte but for the measured times."""

from __future__ import annotations

from pathlib import Path

import msgpack
import pytest
from programs import STEPS, Box, plain, recorded, remote

from protocol import recording
from protocol.messages import StartRun


def run(box: Box, shape: str, out: Path) -> Path:
    """Record the scene once."""
    env, viz = box.env_server(shape), box.viz_client(out)
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun(recorders=1))
        assert viz.wait() == 0
    assert env.wait() == 0
    return out


@pytest.mark.thorough
def test_two_runs_differ_in_nothing_but_the_measured_times(box: Box, shape: str, tmp_path: Path) -> None:
    first, second = (recorded(run(box, shape, tmp_path / name)) for name in ("first", "second"))
    assert len(first) == len(second) == STEPS + 3
    for one, other in zip(first, second, strict=True):
        assert msgpack.packb(one) == msgpack.packb(other)
    frames = plain(tmp_path / "first" / recording.FILE_NAME)[1:-1]
    assert max(frame["touching"]["s"]["shape"][0] for frame in frames) > 0  # the cable does come to lie on the box
