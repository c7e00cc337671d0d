"""The server's loop over a real socket: greetings, requests, repeats, nonsense, the end."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, cable, grasps, random_spans, span, start_from

from protocol import VERSION
from protocol.channel import Client
from protocol.codec import decode, encode
from protocol.errors import CablecosimError
from protocol.kinds import Outcome
from protocol.messages import AnyMessage, Beat, Done, Error, Hello, Message, Pause, Problem, ShapeReply, ShapeRequest, Start, Stop, Welcome
from shape_server.server import ShapeServer

WAIT = 20.0  # s


def request(*problems: Problem, step: int = 0, session: str = "here") -> ShapeRequest:
    return ShapeRequest(session=session, step=step, round=0, gravity=GRAVITY, tolerance=1e-3, problems=problems)


EASY = request(Problem(cable=cable(), grasps=span()))


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Address of a server that runs in a thread of its own until the test ends."""
    server = ShapeServer(f"ipc://{tmp_path}/shape", "numpy")
    thread = threading.Thread(target=server.run)
    thread.start()
    yield server.address
    if thread.is_alive():
        client = Client(server.address, "test")
        reply_to(client, Stop())
        client.close()
    thread.join(WAIT)
    assert not thread.is_alive()


@pytest.fixture
def client(address: str) -> Iterator[Client]:
    client = Client(address, "test")
    yield client
    client.close()


def reply_to(client: Client, message: Message) -> AnyMessage:
    """The reply, after any beats."""
    return decode(reply_bytes(client, message))


def reply_bytes(client: Client, message: Message) -> bytes:
    """The encoded reply, after any beats."""
    client.send(message)
    while (data := client.receive_bytes(WAIT)) is not None:
        if not isinstance(decode(data), Beat):
            return data
    raise AssertionError("no reply")


def test_a_greeting_is_answered_with_version_role_and_kernels(client: Client) -> None:
    welcome = client.greet(WAIT)
    assert welcome == Welcome(version=VERSION, role="shape_server", kernels="numpy")


def test_another_version_is_refused_with_both_versions(client: Client) -> None:
    client.send(Hello(version=VERSION + 1, role="test"))
    answer = client.receive(WAIT)
    assert isinstance(answer, Error)
    assert answer.code == "version"
    assert f"version {VERSION + 1}" in answer.sentence
    assert f"version {VERSION} " in answer.sentence


def test_a_request_is_answered_with_a_shape_for_every_cable(client: Client) -> None:
    problems = random_spans(3, 1e-2, 1)
    reply = reply_to(client, request(*problems, step=7))
    assert isinstance(reply, ShapeReply)
    assert (reply.session, reply.step, reply.round) == ("here", 7, 0)
    assert [shape.outcome for shape in reply.shapes] == [Outcome.CONVERGED] * 3
    for shape, problem in zip(reply.shapes, problems, strict=True):
        np.testing.assert_allclose(shape.nodes[-1], problem.grasps.position[-1], atol=1e-7)
    assert reply.busy > 0


def test_a_request_for_no_cable_is_answered_with_no_shape(client: Client) -> None:
    reply = reply_to(client, request())
    assert isinstance(reply, ShapeReply)
    assert reply.shapes == ()


def test_who_asks_again_by_a_new_connection_gets_what_was_solved(client: Client, address: str) -> None:
    """Solved anew its measured times would be others; and a hard request would be solved anew at every repeat, for ever."""
    first = reply_bytes(client, EASY)
    again = Client(address, "test")
    assert reply_bytes(again, EASY) == first
    again.close()


def test_the_same_request_again_gets_the_same_bytes(client: Client) -> None:
    assert reply_bytes(client, EASY) == reply_bytes(client, EASY)


def test_the_same_key_with_another_request_is_solved_anew(client: Client) -> None:
    first = decode(reply_bytes(client, EASY))
    second = decode(reply_bytes(client, request(Problem(cable=cable(), grasps=span(0.7)))))
    assert isinstance(first, ShapeReply)
    assert isinstance(second, ShapeReply)
    assert second.shapes[0].nodes[-1, 0] == pytest.approx(0.7, abs=1e-7)


def test_another_peer_gets_its_own_answer_to_the_same_key(client: Client, address: str) -> None:
    mine = reply_bytes(client, EASY)
    other = Client(address, "other")
    theirs = decode(reply_bytes(other, request(Problem(cable=cable(), grasps=span(0.7)))))
    other.close()
    assert isinstance(theirs, ShapeReply)
    assert theirs.shapes[0].nodes[-1, 0] == pytest.approx(0.7, abs=1e-7)
    assert isinstance(decode(mine), ShapeReply)


@pytest.mark.parametrize("data", [b"", b"\x00", b"hello", b"\x81\xa4type\xa4none", encode(EASY)[:-7]])
def test_bytes_that_are_no_message_get_an_error_and_change_nothing(client: Client, data: bytes) -> None:
    client.send_bytes(data)
    answer = client.receive(WAIT)
    assert isinstance(answer, Error)
    assert answer.code == "message"
    assert isinstance(reply_to(client, EASY), ShapeReply)


def test_a_message_for_another_program_gets_an_error(client: Client) -> None:
    answer = reply_to(client, Pause())
    assert isinstance(answer, Error)
    assert "Pause means nothing to the shape server" in answer.sentence


def test_a_request_that_is_wrong_gets_an_error_with_its_key(client: Client) -> None:
    start = Start(s=np.linspace(0, 0.9, 11), frames=np.tile(ALONG_X, (10, 1)), grasp_forces=np.zeros((2, 3)))
    answer = reply_to(client, request(Problem(cable=cable(), grasps=span(), start=start)))
    assert isinstance(answer, Error)
    assert answer.key == "start.s"
    assert isinstance(reply_to(client, EASY), ShapeReply)


WILD = [
    lambda: Problem(cable=cable(bending=float("nan")), grasps=span()),
    lambda: Problem(cable=cable(bending=1e300), grasps=span()),
    lambda: Problem(cable=cable(length=1e-300), grasps=grasps((0.0, (0.0, 0.0, 0.0), ALONG_X))),
    lambda: Problem(cable=cable(), grasps=grasps()),
    lambda: Problem(cable=cable(), grasps=grasps((0.5, (0, 0, 0), ALONG_X), (0.5 + 1e-13, (0, 0, 0), ALONG_X))),
]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("wild", WILD)
def test_no_request_ends_the_server(client: Client, wild: object) -> None:
    """A peer may send any numbers; it gets an answer or an error, and the next request is answered."""
    try:
        message = request(wild())  # type: ignore[operator]
    except CablecosimError:
        return  # refused before it is sent: good as well
    answer = reply_to(client, message)
    assert isinstance(answer, Error | ShapeReply)
    if isinstance(answer, ShapeReply):
        assert all(np.isfinite(shape.nodes).all() for shape in answer.shapes)
    assert isinstance(reply_to(client, EASY), ShapeReply)


def test_a_warm_request_is_answered_from_its_start(client: Client) -> None:
    first = reply_to(client, EASY)
    assert isinstance(first, ShapeReply)
    second = reply_to(client, request(Problem(cable=cable(), grasps=span(), start=start_from(first.shapes[0])), step=1))
    assert isinstance(second, ShapeReply)
    assert second.shapes[0].iterations == 1


def test_a_stop_is_confirmed_and_ends_the_loop(address: str) -> None:
    client = Client(address, "test")
    assert reply_to(client, Stop()) == Done()
    client.close()
    time.sleep(0.5)  # until the loop has ended; the fixture then has nothing to stop


def run(*arguments: str, data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    """The program with arguments, in a process of its own."""
    return subprocess.run([sys.executable, "-m", "shape_server", *arguments], input=data, capture_output=True, timeout=60, check=False)


@pytest.mark.thorough
def test_one_posture_is_answered_from_standard_input() -> None:
    done = run("--posture", "-", data=encode(EASY))
    assert done.returncode == 0, done.stderr
    reply = decode(done.stdout)
    assert isinstance(reply, ShapeReply)
    assert reply.shapes[0].outcome is Outcome.CONVERGED
    assert reply.shapes[0].cost.path == "numpy"


@pytest.mark.thorough
@pytest.mark.parametrize("data", [b"", b"nonsense", encode(Stop())])
def test_a_posture_that_is_none_is_refused_with_a_sentence(data: bytes) -> None:
    done = run("--posture", "-", data=data)
    assert done.returncode == 2
    assert done.stdout == b""
    assert done.stderr.startswith(b"shape_server: ")
    assert b"Traceback" not in done.stderr


def test_help_says_what_the_program_does() -> None:
    done = run("--help")
    assert done.returncode == 0
    for word in (b"--bind", b"--posture", b"--warm-up", b"--kernels", b"Predicts the shape of cables"):
        assert word in done.stdout


@pytest.mark.thorough
@pytest.mark.parametrize("address", ["tcp://0.0.0.0:0", "http://x", "ipc://"])
def test_an_address_that_others_could_reach_is_refused(address: str) -> None:
    done = run("--bind", address)
    assert done.returncode == 2
    assert b"address" in done.stderr


@pytest.mark.thorough
def test_the_program_serves_until_it_is_told_to_stop(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "shape_server", "--bind", f"ipc://{tmp_path}/s", "--kernels", "numpy"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONWARNINGS": "error"}) as server:
        assert server.stdout is not None
        address = server.stdout.readline().split()[-1]
        client = Client(address, "test")
        assert client.greet(WAIT).kernels == "numpy"
        assert isinstance(reply_to(client, EASY), ShapeReply)
        assert reply_to(client, Stop()) == Done()
        client.close()
        assert server.wait(WAIT) == 0


def test_the_program_ends_in_good_order_when_terminated(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "shape_server", "--bind", f"ipc://{tmp_path}/s", "--kernels", "numpy"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        server.stdout.readline()
        server.terminate()
        _, errors = server.communicate(timeout=WAIT)
        assert server.returncode == 0
        assert errors == ""
