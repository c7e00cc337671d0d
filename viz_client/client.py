"""Follows a run and records it; pictures and replay page come second.

The stream is joined before the snapshot is asked for, so nothing between the two is missed. Messages are written as they
arrive, undecoded bytes to the file; drawing happens in another process (`painter.py`) or after the end.

Waits, all in seconds: START_LIMIT for the environment to answer and to have a snapshot, GONE_LIMIT once it had answered and
then does no more; SILENCE without a message before the environment is asked whether it lives; ANSWER_LIMIT for its answer.
An environment that lives may be silent for ever.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Final

from protocol import recording
from protocol.channel import Client, Subscriber
from protocol.codec import decode
from protocol.errors import MessageError, PeerLostError
from protocol.messages import Error, Finished, Frame, Snapshot, SnapshotRequest, Statistics, StatisticsRequest

from .painter import DIRECTORY, Painter
from .redraw import page

START_LIMIT: Final = 120.0
GONE_LIMIT: Final = 15.0
SILENCE: Final = 5.0
ANSWER_LIMIT: Final = 5.0
POLL: Final = 0.05  # s between looks at the signal to stop and at the drawing process


@dataclass(frozen=True)
class Watched:
    """What came of following a run."""

    frames: int  # recorded
    missing: int  # sequence numbers that never came, those before joining included
    complete: bool  # whether the run's end was seen
    sentence: str  # how it ended


def watch(
    frames: str,
    control: str,
    out: Path,
    *,
    replay: bool = True,
    pictures: bool = True,
    say: Callable[[str], None] = lambda _line: None,
    stop: Event | None = None,
) -> Watched:
    """Record a run from now to its end, then finish pictures and replay page.

    Args:
        frames: Address of the environment's lossless stream.
        control: Address at which the environment answers.
        out: Folder of the run; made if need be. Must not hold a recording.
        replay: Whether to write `replay.html` at the end.
        pictures: Whether to draw the key postures.
        say: Told one line for each milestone.
        stop: When set, recording ends at once and nothing more is drawn.

    Returns:
        How much was recorded. A run that breaks off is no error: what was recorded is readable, and was drawn.

    Raises:
        AddressError: If an address is malformed or could be reached by others.
        PeerLostError: If no environment answered, or it never had a snapshot; nothing was recorded then.
        VersionError: If the environment speaks another version.
        RecordingError: If the folder holds a recording already, or the disk is full.
    """
    stop = stop or Event()
    stream = Subscriber(frames)
    client = Client(control, "viz_client")
    try:
        return _Session(stream, client, out, say, stop).run(replay=replay, pictures=pictures)
    finally:
        stream.close()
        client.close()


class _Session:
    def __init__(self, stream: Subscriber, client: Client, out: Path, say: Callable[[str], None], stop: Event) -> None:
        self._stream = stream
        self._client = client
        self._out = out
        self._say = say
        self._stop = stop
        self._begin = time.monotonic()
        self._frames = 0
        self._next = 0  # sequence number that comes next
        self._missing = 0
        self._drawn = 0

    def run(self, *, replay: bool, pictures: bool) -> Watched:
        """Record from the snapshot to the end of the run, and write what was asked for beside it."""
        found = self._snapshot()
        if found is None:
            return Watched(0, 0, complete=False, sentence="stopped before the run had begun")
        data, snapshot = found
        triangles = sum(len(solid.triangles) for solid in snapshot.solids)
        self._say(f"snapshot after {self._elapsed()}: {len(snapshot.solids)} solids, {triangles} triangles")
        self._out.mkdir(parents=True, exist_ok=True)
        painter: Painter | None = None
        try:
            with recording.Writer(self._out / recording.FILE_NAME) as writer:
                writer.write(data)
                painter = Painter(self._out, drawn=self._tell_drawn, failed=self._say) if pictures else None
                watched = self._record(snapshot, writer, painter)
            missing = f"{watched.missing} missing" if watched.missing else "none missing"
            self._say(f"recorded {watched.frames} frames in {self._elapsed()}, {missing}: {watched.sentence}")
            if replay and not self._stop.is_set():
                page(self._out, self._say)  # the drawing process is at work meanwhile
            if painter and not self._stop.is_set():
                painter.finish()
        finally:
            if painter:
                painter.close()
        return watched

    def _snapshot(self) -> tuple[bytes, Snapshot] | None:
        """What the scene looks like, as soon as the environment knows; None if told to stop before."""
        greeted, problem, heard = False, "", 0.0
        while self._seconds() < START_LIMIT and not self._stop.is_set():
            try:
                if not greeted:
                    self._client.greet(1.0)
                    greeted, heard = True, time.monotonic()
                self._client.send(SnapshotRequest())
                data = self._client.receive_bytes(ANSWER_LIMIT)
                answer = decode(data) if data else None
            except (PeerLostError, MessageError) as error:
                problem = str(error)
                continue
            if data and isinstance(answer, Snapshot):
                return data, answer
            problem = answer.sentence if isinstance(answer, Error) else "it gave no answer"
            if data:
                heard = time.monotonic()
            elif time.monotonic() - heard > GONE_LIMIT:
                raise PeerLostError(f"the environment at {self._client.address} ended before the run began", key=self._client.address)
            self._stop.wait(POLL)
        if self._stop.is_set():
            return None
        raise PeerLostError(f"no snapshot from {self._client.address} within {START_LIMIT:g} s: {problem}", key=self._client.address)

    def _record(self, snapshot: Snapshot, writer: recording.Writer, painter: Painter | None) -> Watched:
        heard = time.monotonic()
        while not self._stop.is_set():
            data = self._stream.receive(POLL)
            if data is not None:
                heard = time.monotonic()
                ending = self._take(data, snapshot, writer, painter)
                if ending is not None:
                    return ending
            elif time.monotonic() - heard > SILENCE:
                sentence = self._why_silent()
                if sentence:
                    return self._ended(sentence)
                heard = time.monotonic()
            if painter:
                painter.turn()
        return self._ended("told to stop")

    def _take(self, data: bytes, snapshot: Snapshot, writer: recording.Writer, painter: Painter | None) -> Watched | None:
        """Record one message; the result if it was the last."""
        try:
            message = decode(data)
        except MessageError as error:
            self._say(f"a message of {len(data)} bytes is not recorded: {error}")
            return None
        if not isinstance(message, Frame | Finished):
            self._say(f"a {type(message).__name__} has no place in the stream and is not recorded")
            return None
        if message.session != snapshot.session:
            return self._ended("another run began at this address")
        writer.write(data)
        if isinstance(message, Finished):
            self._missing += max(0, message.frames - self._next)
            return Watched(self._frames, self._missing, complete=True, sentence=message.sentence)
        self._count(message)
        if message.picture and painter:
            painter.offer(data, message.picture)
        return None

    def _count(self, frame: Frame) -> None:
        if not self._frames:
            self._say(f"first frame after {self._elapsed()}: number {frame.sequence}")
        if frame.sequence > self._next:
            self._missing += frame.sequence - self._next
            self._say(f"frames {self._next} to {frame.sequence - 1} are missing" + ("" if self._frames else ": joined late"))
        self._frames += 1
        self._next = frame.sequence + 1

    def _why_silent(self) -> str:
        """Why nothing comes any more; empty if the environment lives and is not at its end."""
        try:
            answer = self._client.ask(StatisticsRequest(), ANSWER_LIMIT)
        except PeerLostError:
            return f"the environment was silent for {SILENCE:g} s and did not answer within {ANSWER_LIMIT:g} s"
        if isinstance(answer, Statistics) and answer.state in ("finished", "failed"):
            self._missing += max(0, answer.step + 1 - self._next)
            return f"the environment says that the run is over: {answer.sentence}"
        return ""

    def _ended(self, sentence: str) -> Watched:
        return Watched(self._frames, self._missing, complete=False, sentence=sentence)

    def _tell_drawn(self, path: Path) -> None:
        if not self._drawn:
            self._say(f"first picture after {self._elapsed()}: {DIRECTORY}/{path.name}")
        self._drawn += 1

    def _seconds(self) -> float:
        return time.monotonic() - self._begin

    def _elapsed(self) -> str:
        return f"{self._seconds():.1f} s"
