"""A run of many steps: neither memory nor open files nor the time of a step grow."""

from __future__ import annotations

import time
from pathlib import Path
from statistics import median

import pytest
from programs import SCENE, Box, Program, remote

from protocol import recording
from protocol.messages import StartRun, Statistics

ROPE = SCENE.with_name("rope.toml")
GROWTH = 5_000  # kB from a third of the run to its end; measured 0 to 700 over 100 000 steps
SLOWER = 1.5  # times; a machine that does something else meanwhile


def resident(program: Program) -> int:
    """Physical memory of a process [kB]."""
    lines = Path(f"/proc/{program.process.pid}/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def descriptors(program: Program) -> int:
    """Open files and sockets of a process."""
    return len(list(Path(f"/proc/{program.process.pid}/fd").iterdir()))


@pytest.mark.parametrize(
    "steps", [2_000, pytest.param(100_000, marks=[pytest.mark.slow, pytest.mark.timeout(1800)])], ids=["2000 steps", "100000 steps"]
)
def test_nothing_grows_with_the_number_of_steps(box: Box, tmp_path: Path, steps: int) -> None:
    shape = box.shape_server()
    env = box.env_server(None, "--journal", str(tmp_path / "journal"), scene=ROPE, settings=[f"time_step={3.0 / steps}"])
    viz = box.viz_client(tmp_path)
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun(recorders=1))
        used: list[tuple[int, list[int], list[int]]] = []
        while (state := control.state()).state in ("ready", "running") and viz.process.poll() is None:
            assert isinstance(state, Statistics)
            used.append((state.step, [resident(one) for one in (shape, env, viz)], [descriptors(one) for one in (shape, env, viz)]))
            time.sleep(0.02 * steps / 2000)
        assert state.state == "finished", state.sentence
        assert viz.wait() == 0
    assert env.wait() == 0
    early, late = ([entry for entry in used if low * steps < entry[0] <= high * steps] for low, high in ((0.33, 0.5), (0.83, 1.0)))
    for index in range(3):
        assert median(entry[1][index] for entry in late) - median(entry[1][index] for entry in early) < GROWTH
        assert median(entry[2][index] for entry in late) <= median(entry[2][index] for entry in early)
    frames = recording.read(tmp_path / recording.FILE_NAME).frames
    assert len(frames) == steps + 1
    third = steps // 3
    first, last = (median(frames[step].bill.total for step in steps) for steps in (range(100, third), range(2 * third, 3 * third)))
    assert last < SLOWER * first
