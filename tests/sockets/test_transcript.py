"""What the environment and the shape server say to each other, as text; and the same requests asked again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import programs
import pytest
from listener import Listener
from programs import LIMIT, remote

from protocol.channel import Client

STEP_LAST = 29  # the transcript on file ends where the cable has just begun to touch
FILE = Path(__file__).parent / "transcript.txt"


@contextmanager
def listened() -> Iterator[Listener]:
    """A whole run, and all that was said."""
    with programs.box() as box:
        shape = box.shape_server()
        with Listener(box.at("between"), box.at("shape")) as listener:
            env = box.env_server(box.at("between"), "--start")
            with remote(box) as control:
                assert not control.wait_for("finished", "failed").sentence.startswith("step")
            assert env.wait() == 0
        assert shape.process.poll() is None
        yield listener


@pytest.fixture(scope="module")
def heard() -> Iterator[Listener]:
    with listened() as listener:
        yield listener


@pytest.mark.thorough
def test_the_beginning_of_the_run_reads_as_on_file(heard: Listener) -> None:
    """Write the file anew with `python tests/sockets/test_transcript.py`, after reading what has changed."""
    assert beginning(heard.lines()) == FILE.read_text(encoding="utf-8").splitlines()


def test_requests_and_replies_alternate_and_carry_the_same_keys(heard: Listener) -> None:
    lines = [line.split() for line in heard.lines()[2:]]
    assert [words[3] for words in lines] == ["ShapeRequest", "ShapeReply"] * (len(lines) // 2)
    for request, reply in zip(lines[::2], lines[1::2], strict=True):
        assert request[4:8] == reply[4:8]


@pytest.mark.thorough
def test_a_fresh_server_gives_the_same_replies_but_for_the_measured_times(heard: Listener) -> None:
    requests = [data for sender, data in heard.heard if b"ShapeRequest" in data[:40] and sender == "env -> shape"]
    replies = [data for sender, data in heard.heard if b"ShapeReply" in data[:40] and sender == "shape -> env"]
    assert len(requests) == len(replies) > programs.STEPS
    with programs.box() as box:
        box.shape_server()
        client = Client(box.at("shape"), "test")
        client.greet(LIMIT)
        for request, reply in reversed(list(zip(requests, replies, strict=True))):  # backwards: it keeps nothing between requests
            client.send_bytes(request)
            # A Welcome may come late, if the server was not there yet at the first Hello.
            while (again := client.receive_bytes(LIMIT) or b"")[:20].find(b"Beat") >= 0 or b"Welcome" in again[:20]:
                pass
            assert unmeasured(again) == unmeasured(reply)
        client.close()


def unmeasured(reply: bytes) -> bytes:
    """Bytes of a reply without its times."""
    return msgpack.packb(programs.without_measured(msgpack.unpackb(reply)))


def beginning(lines: list[str]) -> list[str]:
    """Lines up to STEP_LAST."""
    return lines[: next(place for place, line in enumerate(lines) if f"step {STEP_LAST + 1} " in line)]


if __name__ == "__main__":
    with listened() as run:
        FILE.write_text("\n".join(beginning(run.lines())) + "\n", encoding="utf-8")
