"""Messages that are lost, late, doubled, out of order or stale: the recording is as of an undisturbed run."""

from __future__ import annotations

from pathlib import Path

import programs
import pytest
from programs import STEPS, Box, recorded, remote
from proxy import Proxy

from protocol.messages import StartRun

SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))]


@pytest.fixture(scope="module")
def undisturbed(shape: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run over good lines."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with programs.box() as made:
        finish(made, made.env_server(shape), made.viz_client(folder))
    return folder


def finish(box: Box, env: programs.Program, viz: programs.Program) -> None:
    """From the start of a run to its end."""
    with remote(box) as control:
        control.wait_for("ready")
        control.tell(StartRun(recorders=1))
        assert viz.wait(280) == 0, viz.words
    assert env.wait() == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_bad_line_to_the_shape_server_costs_time_and_nothing_else(
    box: Box, shape: str, tmp_path: Path, undisturbed: Path, seed: int
) -> None:
    with Proxy(box.at("between"), shape, seed) as line:
        finish(box, box.env_server(box.at("between")), box.viz_client(tmp_path))
    assert all(line.troubles[kind] >= 2 for kind in ("lost", "late", "doubled", "stale")), line.troubles
    assert recorded(tmp_path) == recorded(undisturbed)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", SEEDS)
def test_a_bad_line_to_the_recorder_is_made_up_for_from_the_journal(
    box: Box, shape: str, tmp_path: Path, undisturbed: Path, seed: int
) -> None:
    env = box.env_server(shape, "--journal", str(tmp_path / "journal"))
    with Proxy(box.at("between"), box.at("frames"), seed, stream=True, share=0.12) as line:
        where = ("--frames", box.at("between"), "--control", box.at("control"), "--out", str(tmp_path))
        finish(box, env, box.start("viz_client", *where, "--no-replay", "--no-pictures"))
    assert line.troubles.total() >= STEPS
    assert all(line.troubles[kind] >= 2 for kind in ("lost", "late", "doubled", "stale")), line.troubles
    assert recorded(tmp_path) == recorded(undisturbed)
