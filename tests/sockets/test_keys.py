"""Beyond loopback only with keys, and with keys only those that are known."""

from __future__ import annotations

import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from programs import LIMIT, SCENE, STEPS, Box, recorded, resolved, until

from protocol import VERSION, keys
from protocol.channel import Client, Publisher, Server, Subscriber
from protocol.errors import AddressError, PeerLostError
from protocol.keys import Keys
from protocol.messages import StartRun, StatisticsRequest, Welcome
from protocol.sockets import key_pair


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("keys") / "ours"
    keys.make(made, key_pair)
    return made


@pytest.fixture
def guarded(folder: Path) -> Iterator[Server]:
    """A server with keys, on loopback."""
    server = Server("tcp://127.0.0.1:0", lambda: Welcome(version=VERSION, role="test"), keys=keys.read(folder))
    yield server
    server.close()


def greeted(server: Server, with_keys: Keys | None, tries: int = 10) -> str:
    """What a client hears who says hello, within so many tenths of a second."""
    with closing(Client(server.address, "test", with_keys)) as client:
        try:
            client.send_bytes(b"\x82\xa4type\xa5Hello\xa4role\xa1x")
        except PeerLostError:  # the connection was refused before there was anything to say
            return ""
        for _ in range(tries):
            server.receive(0.05)
            if (data := client.receive_bytes(0.05)) is not None:
                return data.decode(errors="replace")
    return ""


def test_the_command_makes_keys_that_only_their_owner_can_read(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from scenarios.cli import main; main()", "keys", str(tmp_path / "mine")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    made = sorted(str(path.relative_to(tmp_path / "mine")) for path in (tmp_path / "mine").rglob("*"))
    assert made == ["client.key", "client.pub", "known", "known/client.pub", "server.key", "server.pub"]
    for path in (tmp_path / "mine", *(tmp_path / "mine").rglob("*")):
        assert not stat.S_IMODE(path.stat().st_mode) & 0o077, path
    again = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert again.returncode == 2
    assert "is not empty; give a new folder, for no key is overwritten" in again.stderr


def test_who_has_a_known_key_is_served(guarded: Server, folder: Path) -> None:
    assert "Error" in greeted(guarded, keys.read(folder), 300)  # an answer: what was said is no whole message


@pytest.mark.thorough
def test_who_has_an_unknown_key_or_none_is_not_heard(guarded: Server, folder: Path, tmp_path: Path) -> None:
    keys.make(tmp_path / "strange", key_pair)
    strange, ours = keys.read(tmp_path / "strange"), keys.read(folder)
    unknown = Keys(ours.server_public, "", strange.client_public, strange.client_secret, frozenset())
    wrong_server = Keys(strange.server_public, "", ours.client_public, ours.client_secret, frozenset())
    for stranger in (unknown, wrong_server, None):
        assert greeted(guarded, stranger) == ""
    assert guarded.rejected == 0
    assert "Error" in greeted(guarded, ours, 300)


def test_a_stranger_gets_nothing_of_a_stream(folder: Path, tmp_path: Path) -> None:
    keys.make(tmp_path / "strange", key_pair)
    ours, strange = keys.read(folder), keys.read(tmp_path / "strange")
    stranger = Keys(ours.server_public, "", strange.client_public, strange.client_secret, frozenset())
    with (
        closing(Publisher("tcp://127.0.0.1:0", lossless=True, keys=ours)) as stream,
        closing(Subscriber(stream.address, keys=ours)) as known,
        closing(Subscriber(stream.address, keys=stranger)) as unknown,
        closing(Subscriber(stream.address)) as open_one,
    ):
        assert stream.wait_for(1, LIMIT)
        stream.publish(b"a frame")
        assert known.receive(LIMIT) == b"a frame"
        assert unknown.receive(0.3) is None
        assert open_one.receive(0.0) is None
        assert stream.subscribers == 1


@pytest.mark.parametrize("address", ["tcp://0.0.0.0:0", "tcp://*:0", "tcp://192.0.2.7:5555", "tcp://example.org:5555"])
def test_an_address_that_others_can_reach_is_refused_without_keys(address: str) -> None:
    with pytest.raises(AddressError, match=r"can be reached by others; give keys with --keys DIR"):
        Server(address, lambda: Welcome(version=VERSION, role="test"))
    with pytest.raises(AddressError, match=r"can be reached by others"):
        Client(address, "test")


def test_an_address_that_others_can_reach_may_be_listened_at_with_keys(folder: Path) -> None:
    ours = keys.read(folder)
    with closing(Server("tcp://0.0.0.0:0", lambda: Welcome(version=VERSION, role="test"), keys=ours)) as server:
        port = server.address.rpartition(":")[2]
        with closing(Client(f"tcp://127.0.0.1:{port}", "test", ours)) as client:
            client.send_bytes(b"\xc0")
            assert until(lambda: (server.receive(0.05), client.receive_bytes(0.05))[1])


def test_the_socket_of_an_ipc_address_is_for_its_owner_alone(box: Box) -> None:
    with closing(Server(box.at("mine"), lambda: Welcome(version=VERSION, role="test"))):
        assert not stat.S_IMODE((box.path / "mine").stat().st_mode) & 0o077


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda made: (made / "client.key").chmod(0o644), "may be read by others; say: chmod 600"),
        (lambda made: (made / "server.pub").unlink(), "server.pub: cannot be read as a key; make keys with: cablecosim keys DIR"),
        (lambda made: (made / "client.pub").write_text("short"), "client.pub: 5 characters are no key of 40"),
    ],
)
def test_keys_that_are_none_are_refused_with_a_sentence(spoil: object, sentence: str, folder: Path, tmp_path: Path, box: Box) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    spoil(tmp_path / "copy")  # type: ignore[operator]
    program = box.start("shape_server", "--bind", box.at("shape"), "--keys", str(tmp_path / "copy"))
    assert program.wait() == 2
    assert sentence in program.words
    assert "Traceback" not in program.words


@pytest.mark.thorough
def test_a_whole_run_is_encrypted_and_a_stranger_on_the_way_reads_nothing(box: Box, folder: Path, tmp_path: Path) -> None:
    """Over tcp, as between machines; the address is a loopback one, for tests do not listen beyond."""
    given = ("--keys", str(folder))
    shape = box.start("shape_server", "--bind", "tcp://127.0.0.1:0", "--kernels", "compiled", *given)
    address = until(lambda: re.search(r"tcp://127\.0\.0\.1:\d+", shape.words))[0]
    where = [word for name in ("frames", "live", "control") for word in (f"--{name}", "tcp://127.0.0.1:0")]
    env = box.start("env_server", "--scene", str(resolved(box.path)), "--shape", address, *where, *given)
    found = {name: until(lambda name=name: re.search(rf"{name} +(tcp://\S+)", env.words))[1] for name in ("frames", "control")}
    viz = box.start("viz_client", "--frames", found["frames"], "--control", found["control"], "--out", str(tmp_path), "--no-replay", *given)
    ours = keys.read(folder)
    with closing(Client(found["control"], "stranger")) as stranger, pytest.raises(PeerLostError, match="is the program started"):
        stranger.greet(1.0)
    with closing(Client(found["control"], "test", ours)) as control:
        control.greet(LIMIT)
        until(lambda: control.ask(StatisticsRequest(), LIMIT).state == "ready" or None)
        control.ask(StartRun(recorders=1), LIMIT)
        assert viz.wait() == 0
    assert len(recorded(tmp_path)) == STEPS + 3


@pytest.mark.slow
def test_the_launcher_runs_with_keys(folder: Path, tmp_path: Path) -> None:
    command = ["run", str(SCENE), "--out", str(tmp_path / "run"), "--no-replay", "--keys", str(folder), "--kernels", "compiled"]
    done = subprocess.run(
        [sys.executable, "-c", "from scenarios.cli import main; main()", *command],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert len(recorded(tmp_path / "run")) == STEPS + 3
