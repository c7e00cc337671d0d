"""A client that knows only docs/protocol.md, pyzmq and msgpack drives either server."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from programs import LIMIT, STEPS, Box

import protocol

CLIENT = Path(__file__).parent / "plain_client.py"


def ask(*arguments: str) -> dict[str, Any]:
    """What the client found; -I keeps our folder off its path."""
    run = subprocess.run([sys.executable, "-I", str(CLIENT), *arguments], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert run.returncode == 0, run.stderr
    found: dict[str, Any] = json.loads(run.stdout)
    assert found["ours"] == []
    assert {"type": "Welcome", "version": protocol.VERSION, "project": "cablecosim"}.items() <= found["welcome"].items()
    return found


def test_it_gets_a_shape_from_the_shape_server(shape: str) -> None:
    found = ask("shape", shape)
    assert found["welcome"]["role"] == "shape_server"
    assert found["key"] == ["plain", 0, 0]
    assert found["again"]  # the very same reply, the measured times included
    assert found["error"] == ["Error", "message", "tolerance"]
    assert found["outcome"] == "converged"
    assert found["nodes"][0] == pytest.approx([-0.4, 0, 0], abs=1e-6)
    assert found["nodes"][-1] == pytest.approx([0.4, 0, 0], abs=1e-6)
    assert -0.5 < min(node[2] for node in found["nodes"]) < -0.1
    assert found["force"] == pytest.approx([0, 0, 0.06 * 9.81], abs=1e-6)  # the hands carry the weight and nothing else


@pytest.mark.thorough
def test_it_starts_a_run_and_follows_it_to_its_end(box: Box, shape: str) -> None:
    environment = box.env_server(shape)
    found = ask("env", box.at("control"), box.at("frames"))
    assert found["welcome"]["role"] == "env_server"
    assert (found["title"], found["solids"], found["steps"]) == ("A cable is laid on a box", ["box"], STEPS)
    assert found["started"] == found["stopped"] == {"type": "Done"}
    assert found["sequences"] == list(range(STEPS + 1))
    assert 0 < found["lowest"] < 0.02
    assert found["finished"]["frames"] == STEPS + 1
    assert not found["finished"]["failed"]
    assert found["state"] == "finished"
    assert environment.wait() == 0
