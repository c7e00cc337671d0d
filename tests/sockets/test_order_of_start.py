"""The programs start by hand, in any order, on addresses given to them."""

from __future__ import annotations

import itertools
import re
import time
from pathlib import Path

import pytest
from programs import STEPS, Box, recorded, remote, resolved, until

from protocol.channel import Client
from protocol.messages import Done, StartRun, Stop

ORDERS = list(itertools.permutations(["shape_server", "env_server", "viz_client"]))


@pytest.mark.parametrize("order", [*ORDERS[::5], *(pytest.param(order, marks=pytest.mark.slow) for order in ORDERS[1:5])], ids=" ".join)
def test_the_programs_may_be_started_in_any_order(box: Box, tmp_path: Path, order: tuple[str, ...]) -> None:
    programs = {}
    for name in order:
        programs[name] = box.viz_client(tmp_path) if name == "viz_client" else getattr(box, name)()
        time.sleep(0.3)  # so that the first has begun to wait for those that come after it
    with remote(box) as control:
        control.wait_for("ready")
        assert isinstance(control.tell(StartRun(recorders=1)), Done)
        assert programs["viz_client"].wait() == 0
    assert programs["env_server"].wait() == 0
    shape = Client(box.at("shape"), "test")
    assert isinstance(shape.ask(Stop(), 30.0), Done)
    shape.close()
    assert programs["shape_server"].wait() == 0
    messages = recorded(tmp_path)
    assert [message["type"] for message in messages] == ["Snapshot", *["Frame"] * (STEPS + 1), "Finished"]
    assert [message["sequence"] for message in messages[1:-1]] == list(range(STEPS + 1))
    assert not messages[-1]["failed"]


def test_a_free_port_is_taken_and_printed(box: Box, tmp_path: Path) -> None:
    server = box.shape_server("tcp://127.0.0.1:0")
    found = until(lambda: re.search(r"tcp://127\.0\.0\.1:([1-9]\d*)", server.words))
    client = Client(found[0], "test")
    assert client.greet(30.0).role == "shape_server"
    client.close()


@pytest.mark.thorough
def test_an_environment_without_addresses_makes_private_ones_and_prints_them(box: Box, shape: str) -> None:
    env = box.start("env_server", "--scene", str(resolved(box.path)), "--shape", shape, "--start")
    found = until(lambda: re.search(r"^control +(ipc://\S+)$", env.words, re.MULTILINE))
    folder = Path(found[1].removeprefix("ipc://")).parent
    assert folder.stat().st_mode & 0o777 == 0o700
    client = Client(found[1], "test")
    client.greet(30.0)
    assert isinstance(client.ask(Stop(), 30.0), Done)
    client.close()
    assert env.wait() == 0
    assert not folder.exists()
