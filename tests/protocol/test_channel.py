"""Sockets: addresses, greetings, time-outs, streams; what is malformed or late harms nobody."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
import zmq
from every_message import request

from protocol import PROJECT, VERSION
from protocol.address import check_address, private_directory
from protocol.channel import SIZE_MAX, Client, Publisher, Server, Subscriber
from protocol.codec import encode
from protocol.errors import AddressError, MessageError, PeerLostError, VersionError
from protocol.messages import Done, Error, Finished, Hello, Statistics, StatisticsRequest, Stop, Welcome

LIMIT = 20.0  # s for anything that should take milliseconds


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder with a path short enough for ipc."""
    with tempfile.TemporaryDirectory(prefix="cc-") as made:
        yield Path(made)


@pytest.fixture
def server(folder: Path) -> Iterator[Server]:
    """Answers `StatisticsRequest` and nothing else, in a thread."""
    made = Server(f"ipc://{folder}/server", lambda: Welcome(version=VERSION, role="test"))
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            received = made.receive(0.02)
            if received is not None and isinstance(received[1], StatisticsRequest):
                made.send(received[0], Statistics(step=1, steps=2, state="running", sentence="running"))

    thread = threading.Thread(target=serve)
    thread.start()
    yield made
    over.set()
    thread.join()
    made.close()


def raw(address: str) -> zmq.Socket[bytes]:
    """A socket that checks nothing."""
    socket = zmq.Context.instance().socket(zmq.DEALER)
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(address)
    return socket


@pytest.mark.parametrize(
    "address",
    [
        "tcp://0.0.0.0:5555", "tcp://*:5555", "tcp://192.168.1.7:5555", "tcp://[::]:5555", "tcp://example.org:5555",
        "tcp://127.0.0.1.example.org:1", "tcp://eth0:5555", "tcp://:5555", "tcp://", "ipc://", "ipc:", "", "nonsense",
        "inproc://x", "udp://127.0.0.1:5", "/tmp/socket", "ipc:///" + 100 * "x",
    ],
)  # fmt: skip
def test_an_address_that_others_could_reach_or_that_is_none_is_refused_everywhere(address: str) -> None:
    for use in (
        check_address,
        lambda a: Client(a, "test"),
        Subscriber,
        lambda a: Publisher(a, lossless=True),
        lambda a: Server(a, Welcome),
    ):
        with pytest.raises(AddressError) as caught:
            use(address)
        assert caught.value.key == address
        assert f"address '{address}': " in str(caught.value)


@pytest.mark.parametrize(
    "address", ["ipc:///tmp/a/b", "tcp://127.0.0.1:5555", "tcp://localhost:5555", "tcp://127.0.0.1:0", "ipc:///" + 99 * "x"]
)
def test_an_address_of_our_own_is_accepted(address: str) -> None:
    check_address(address)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:0", "tcp://127.0.0.1:*", "tcp://localhost:0"])
def test_port_zero_takes_a_free_one_and_says_which(address: str) -> None:
    with closing(Server(address, Welcome)) as first, closing(Server(address, Welcome)) as second:
        assert first.address != second.address
        assert all(int(one.address.rpartition(":")[2]) > 0 for one in (first, second))
        assert all(one.address.startswith("tcp://127.0.0.1:") for one in (first, second))


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:port", "tcp://127.0.0.1:99999", "tcp://127.0.0.1:-1", "tcp://127.0.0.1", "tcp://127.0.0.1:"]
)
def test_a_port_that_is_none_is_refused_with_a_sentence_on_either_side(address: str) -> None:
    for use in (lambda: Server(address, Welcome), lambda: Client(address, "test"), lambda: Subscriber(address)):
        with ExitStack() as stack, pytest.raises(AddressError, match=f"address '{address}'"):
            stack.enter_context(closing(use()))


def test_a_second_program_at_one_address_is_refused_and_the_first_still_served(server: Server) -> None:
    for make in (lambda: Server(server.address, Welcome), lambda: Publisher(server.address, lossless=True)):
        with pytest.raises(AddressError, match="another program answers there"):
            make()
    with closing(Client(server.address, "test")) as client:
        assert client.greet(LIMIT).role == "test"


def test_an_address_is_free_again_after_its_owner_has_gone(folder: Path) -> None:
    for _ in range(3):
        with closing(Server(f"ipc://{folder}/again", Welcome)) as server, closing(Client(server.address, "test")) as client:
            client.send(Stop())
            assert (server.receive(LIMIT) or (b"", None))[1] == Stop()


def test_a_taken_port_and_a_folder_that_does_not_exist_are_refused_with_a_sentence(folder: Path) -> None:
    with closing(Server("tcp://127.0.0.1:0", Welcome)) as first, pytest.raises(AddressError, match="cannot be bound"):
        Server(first.address, Welcome)
    with pytest.raises(AddressError, match="cannot be made"):
        Server(f"ipc://{folder}/nowhere/server", Welcome)


def test_a_private_directory_admits_its_owner_only() -> None:
    made = private_directory()
    assert made.stat().st_mode & 0o777 == 0o700
    assert made.stat().st_uid == os.getuid()
    assert len(os.fsencode(made)) < 80
    shutil.rmtree(made)


@pytest.mark.parametrize(
    ("hello", "words"),
    [
        (
            Hello(version=VERSION + 1, role="viewer"),
            f"the peer 'viewer' speaks version {VERSION + 1} of '{PROJECT}', this program version {VERSION}",
        ),
        (Hello(version=VERSION, role="viewer", project="protocol"), f"'viewer' speaks version {VERSION} of 'protocol'"),
    ],
)
def test_another_version_or_project_is_answered_by_an_error(server: Server, hello: Hello, words: str) -> None:
    with closing(Client(server.address, "test")) as client:
        answer = client.ask(hello, LIMIT)
        assert isinstance(answer, Error)
        assert answer.code == "version"
        assert words in answer.sentence
        assert "install the same version on both sides" in answer.sentence


def test_a_client_of_another_version_gets_an_exception(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(Client(server.address, "old")) as client:
        send = client.send
        monkeypatch.setattr(client, "send", lambda _: send(Hello(version=VERSION + 1, role="old")))
        with pytest.raises(VersionError, match=f"the peer 'old' speaks version {VERSION + 1}"):
            client.greet(LIMIT)


def test_nobody_there_ends_in_a_sentence_within_the_time_out(folder: Path) -> None:
    begun = time.monotonic()
    with closing(Client(f"ipc://{folder}/nobody", "test")) as client:
        with pytest.raises(PeerLostError, match=r"nobody answered at ipc://\S+/nobody within 0\.3 s; is the program started\?"):
            client.greet(0.3)
        with pytest.raises(PeerLostError, match=r"did not answer a Stop within 0\.2 s"):
            client.ask(Stop(), 0.2)
        assert client.receive(0.0) is None
    assert time.monotonic() - begun < LIMIT


def test_what_was_said_before_the_server_came_reaches_it(folder: Path) -> None:
    with closing(Client(f"ipc://{folder}/late", "test")) as client:
        client.send(Stop())
        with closing(Server(f"ipc://{folder}/late", Welcome)) as server:
            received = server.receive(LIMIT)
    assert received is not None
    assert received[1] == Stop()


def test_greetings_that_were_repeated_are_not_taken_for_answers(folder: Path) -> None:
    with closing(Client(f"ipc://{folder}/slow", "test")) as client:
        for _ in range(3):
            client.send(Hello(version=VERSION, role="test"))
        server = Server(f"ipc://{folder}/slow", lambda: Welcome(version=VERSION, role="test"))
        thread = threading.Thread(target=lambda: [answer(server) for _ in range(4)])
        thread.start()
        assert isinstance(client.ask(StatisticsRequest(), LIMIT), Done)
        thread.join()
        server.close()


def answer(server: Server) -> None:
    """Answer one message by `Done`; greetings are answered by the server itself."""
    received = server.receive(LIMIT)
    if received is not None:
        server.send(received[0], Done())


@pytest.mark.parametrize(
    "parts",
    [
        [b""],
        [b"no message"],
        [b"\xc1"],
        [b"\x81\xa4type\xa4Nope"],
        [encode(Stop()), encode(Stop())],
        [b"", encode(Stop())],
        [b"\x91" * 100_000],
    ],
    ids=["empty", "text", "never used", "unknown", "two parts", "as REQ sends it", "nested"],
)
def test_what_is_no_message_is_answered_by_an_error_and_others_are_still_served(server: Server, parts: list[bytes]) -> None:
    with closing(raw(server.address)) as wild, closing(Client(server.address, "test")) as other:
        wild.send_multipart(parts)
        assert wild.poll(int(1000 * LIMIT))
        assert b"Error" in wild.recv()
        assert isinstance(other.ask(StatisticsRequest(), LIMIT), Statistics)
        wild.send(encode(StatisticsRequest()))  # and so is this one
        assert wild.poll(int(1000 * LIMIT))
        assert b"running" in wild.recv()
    assert server.rejected == 1


def test_a_message_above_the_limit_hangs_up_on_its_sender_and_others_are_still_served(server: Server) -> None:
    with closing(raw(server.address)) as wild, closing(Client(server.address, "test")) as other:
        wild.send(bytes(SIZE_MAX + 1))
        assert not wild.poll(300)
        assert isinstance(other.ask(StatisticsRequest(), LIMIT), Statistics)


def test_a_message_above_the_limit_is_refused_before_it_is_sent(server: Server) -> None:
    with closing(Client(server.address, "test")) as client, pytest.raises(MessageError, match=r"the message has \d+\.\d MiB; at most"):
        client.send_bytes(bytes(SIZE_MAX + 1))


def test_what_is_no_zmq_at_all_harms_nobody() -> None:
    import socket

    with ExitStack() as stack:
        server = stack.enter_context(closing(Server("tcp://127.0.0.1:0", lambda: Welcome(version=VERSION, role="test"))))
        wild = stack.enter_context(socket.create_connection(("127.0.0.1", int(server.address.rpartition(":")[2]))))
        wild.sendall(b"GET / HTTP/1.1\r\n\r\n" * 1000)
        client = stack.enter_context(closing(Client(server.address, "test")))
        client.send(Stop())
        received = None
        end = time.monotonic() + LIMIT
        while received is None and time.monotonic() < end:
            received = server.receive(0.1)
        assert received is not None
        assert received[1] == Stop()


def test_a_reply_to_a_peer_that_has_gone_is_dropped(folder: Path) -> None:
    with closing(Server(f"ipc://{folder}/server", Welcome)) as server:
        with closing(Client(server.address, "test")) as client:
            client.send(Stop())
            peer, _ = server.receive(LIMIT) or (b"", None)
        time.sleep(0.2)
        server.send(peer, Done())
        server.send(b"never there", Done())
        with closing(Client(server.address, "test")) as other:
            other.send(Stop())
            peer, message = server.receive(LIMIT) or (b"", None)
            assert message == Stop()
            server.send(peer, Done())
            assert other.receive(LIMIT) == Done()


def test_every_recorder_is_counted(folder: Path) -> None:
    """Three subscribers to the same stream are three, not one."""
    with closing(Publisher(f"ipc://{folder}/frames", lossless=True)) as stream, ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(closing(Subscriber(stream.address)))
        assert stream.wait_for(3, 3.0)


def test_waiting_for_a_recorder_that_does_not_come_ends(folder: Path) -> None:
    with closing(Publisher(f"ipc://{folder}/frames", lossless=True)) as stream:
        assert stream.wait_for(0, 0.0)
        assert not stream.wait_for(1, 0.1)


def test_who_joins_late_gets_what_is_sent_from_then_on(folder: Path) -> None:
    with closing(Publisher(f"ipc://{folder}/frames", lossless=True)) as stream:
        stream.publish(b"before")
        with closing(Subscriber(stream.address)) as late:
            assert stream.wait_for(1, LIMIT)
            stream.publish(b"after")
            assert late.receive(LIMIT) == b"after"
            assert late.receive(0.05) is None


def test_a_lossless_stream_keeps_everything_in_order_for_who_does_not_read(folder: Path) -> None:
    frame = encode(request())
    with closing(Publisher(f"ipc://{folder}/frames", lossless=True)) as stream, closing(Subscriber(stream.address)) as lazy:
        assert stream.wait_for(1, LIMIT)
        for number in range(3000):
            stream.publish(number.to_bytes(4, "big") + frame)
        assert [int.from_bytes((lazy.receive(LIMIT) or b"")[:4], "big") for _ in range(3000)] == list(range(3000))


def test_a_live_viewer_that_does_not_read_sees_the_newest_only_and_holds_nothing_up(folder: Path) -> None:
    with (
        closing(Publisher(f"ipc://{folder}/live", lossless=False)) as stream,
        closing(Subscriber(stream.address, latest_only=True)) as lazy,
    ):
        assert stream.wait_for(1, LIMIT)
        begun = time.monotonic()
        for number in range(3000):
            stream.publish(number.to_bytes(4, "big") + bytes(2000))
        assert time.monotonic() - begun < LIMIT
        time.sleep(0.1)
        stream.publish(encode(Finished(session="a", frames=1, failed=False, sentence="finished")))
        end, newest = time.monotonic() + LIMIT, b""
        seen = 0
        while b"Finished" not in newest and time.monotonic() < end:
            newest, seen = lazy.receive(1.0) or newest, seen + 1
        assert b"Finished" in newest
        assert seen < 3000
        assert lazy.receive(0.05) is None


def test_a_hundred_clients_get_each_their_own_answers(server: Server) -> None:
    with ExitStack() as stack:
        clients = [stack.enter_context(closing(Client(server.address, "test"))) for _ in range(100)]
        for client in clients:
            client.send(StatisticsRequest())
        assert all(isinstance(client.receive(LIMIT), Statistics) for client in clients)
