"""Follows a run and records it; pictures and replay page come second.

The stream is joined before the snapshot is asked for, so nothing between the two is missed. Messages are written as they
arrive, undecoded bytes to the file; drawing happens in another process (`painter.py`) or after the end. A frame that did not
come, because this program or the environment was killed meanwhile, is asked for again; an environment with a journal has it.

Waits, all in seconds: START_LIMIT for the environment to answer and to have a snapshot, GONE_LIMIT once it had answered and
then does no more; SILENCE without a message before the environment is asked whether it lives; ANSWER_LIMIT for its answer; and
`patience` for one that is gone to come back. An environment that lives may be silent for ever.
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
from protocol.errors import MessageError, PeerLostError, RecordingError
from protocol.keys import Keys
from protocol.messages import Error, Finished, Frame, FrameRequest, Snapshot, SnapshotRequest, Statistics, StatisticsRequest

from .painter import DIRECTORY, Painter
from .redraw import page, redraw, report
from .tape import Tape

START_LIMIT: Final = 120.0
GONE_LIMIT: Final = 15.0
SILENCE: Final = 5.0
ANSWER_LIMIT: Final = 5.0
ASKED_AGAIN: Final = 3  # times, for a frame that did not come
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
    resume: bool = False,
    patience: float = 0.0,
    keys: Keys | None = None,
    say: Callable[[str], None] = lambda _line: None,
    stop: Event | None = None,
) -> Watched:
    """Record a run from now to its end, then finish pictures and replay page.

    Args:
        frames: Address of the environment's lossless stream.
        control: Address at which the environment answers.
        out: Folder of the run; made if need be. Must not hold a recording, unless that is to be gone on with.
        replay: Whether to write `replay.html` and `report.html` at the end.
        pictures: Whether to draw the key postures.
        resume: Whether to go on with a recording of this run that was broken off; there need not be one.
        patience: [s] How long to wait for an environment that is gone to come back.
        keys: For both sockets.
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
    before = _recorded(out / recording.FILE_NAME) if resume else None
    if before is not None and before.finished is not None:
        redraw(out, replay=replay, pictures=pictures, say=say)
        return Watched(len(before.frames), 0, complete=True, sentence=before.finished.sentence)
    stream = Subscriber(frames, keys=keys)
    client = Client(control, "viz_client", keys)
    try:
        return _Session(stream, client, out, say, stop, before, patience).run(replay=replay, pictures=pictures)
    finally:
        stream.close()
        client.close()


def _recorded(file: Path) -> recording.Recording | None:
    """What is recorded already; a file that was broken off in its first message is removed."""
    if not file.exists():
        return None
    try:
        return recording.read(file)
    except RecordingError:
        file.unlink()
        return None


class _Session:
    def __init__(
        self,
        stream: Subscriber,
        client: Client,
        out: Path,
        say: Callable[[str], None],
        stop: Event,
        before: recording.Recording | None,
        patience: float,
    ) -> None:
        self._stream = stream
        self._client = client
        self._out = out
        self._say = say
        self._stop = stop
        self._before = before
        self._patience = patience
        self._begin = time.monotonic()
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
        before = self._before
        if before is not None and before.snapshot.session != snapshot.session:
            raise RecordingError(
                f"recording {self._out / recording.FILE_NAME} is of another scene; give another folder", key=str(self._out)
            )
        try:
            with recording.Writer(self._out / recording.FILE_NAME, keep=before.size if before is not None else None) as writer:
                if before is None:
                    writer.write(data)
                painter = Painter(self._out, drawn=self._tell_drawn, failed=self._say) if pictures else None
                tape = Tape(writer, painter, self._say, self._elapsed)
                if before is not None:
                    tape.go_on(before)
                watched = self._record(snapshot, tape, painter)
            missing = f"{watched.missing} missing" if watched.missing else "none missing"
            self._say(f"recorded {watched.frames} frames in {self._elapsed()}, {missing}: {watched.sentence}")
            if replay and not self._stop.is_set():
                page(self._out, self._say)  # the drawing process is at work meanwhile
            if painter and not self._stop.is_set():
                painter.finish()
            if replay and not self._stop.is_set():
                report(self._out, self._say)
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

    def _record(self, snapshot: Snapshot, tape: Tape, painter: Painter | None) -> Watched:
        heard = answered = time.monotonic()
        ending = self._fill(None, snapshot, tape) if self._before is not None else None
        while ending is None and not self._stop.is_set():
            data = self._stream.receive(POLL)
            if data is not None:
                heard = answered = time.monotonic()
                ending = self._take(data, snapshot, tape)
            elif time.monotonic() - heard > SILENCE:
                try:
                    ending = self._look(snapshot, tape)
                    answered = time.monotonic()
                except PeerLostError:
                    if time.monotonic() - answered > self._patience:
                        sentence = f"the environment was silent for {SILENCE:g} s and did not answer within {ANSWER_LIMIT:g} s"
                        ending = _broken_off(tape, sentence)
                heard = time.monotonic()
            if painter:
                painter.turn()
        return ending or _broken_off(tape, "told to stop")

    def _look(self, snapshot: Snapshot, tape: Tape) -> Watched | None:
        """Whether a run from which nothing comes is over, and how; None if it lives."""
        state = self._client.ask(StatisticsRequest(), ANSWER_LIMIT)
        ending = self._fill(None, snapshot, tape)
        if ending is None and isinstance(state, Statistics) and state.state in ("finished", "failed"):
            tape.missing += max(0, state.step + 1 - tape.next)
            ending = _broken_off(tape, f"the environment says that the run is over: {state.sentence}")
        return ending

    def _take(self, data: bytes, snapshot: Snapshot, tape: Tape) -> Watched | None:
        """Record one message of the stream, after those before it that did not come; the result if it was the last."""
        try:
            message = decode(data)
        except MessageError as error:
            self._say(f"a message of {len(data)} bytes is not recorded: {error}")
            return None
        if not isinstance(message, Frame | Finished):
            self._say(f"a {type(message).__name__} has no place in the stream and is not recorded")
            return None
        if message.session != snapshot.session:
            return _broken_off(tape, "another run began at this address")
        sequence = message.sequence if isinstance(message, Frame) else message.frames
        if sequence > tape.next:
            self._fill(sequence, snapshot, tape)
        tape.keep(data, message)
        return _complete(tape, message) if isinstance(message, Finished) else None

    def _fill(self, until: int | None, snapshot: Snapshot, tape: Tape) -> Watched | None:
        """Record what the environment's journal has from the next frame on, up to a frame or as far as it goes; the result if it ends."""
        while (until is None or tape.next < until) and not self._stop.is_set():
            data = self._again(tape.next)
            message = decode(data) if data is not None else None
            if data is None or not isinstance(message, Frame | Finished) or message.session != snapshot.session:
                return None
            tape.keep(data, message)
            if isinstance(message, Finished):
                return _complete(tape, message)
        return None

    def _again(self, sequence: int) -> bytes | None:
        """A message that went by; None if the environment keeps none, or has none yet."""
        for _ in range(ASKED_AGAIN):
            self._client.send(FrameRequest(sequence=sequence))
            end = time.monotonic() + ANSWER_LIMIT
            while (left := end - time.monotonic()) > 0 and not self._stop.is_set():
                data = self._client.receive_bytes(left)
                answer = decode(data) if data is not None else None
                if isinstance(answer, Error):
                    return None
                if isinstance(answer, Finished) or (isinstance(answer, Frame) and answer.sequence == sequence):
                    return data
        return None

    def _tell_drawn(self, path: Path) -> None:
        if not self._drawn:
            self._say(f"first picture after {self._elapsed()}: {DIRECTORY}/{path.name}")
        self._drawn += 1

    def _seconds(self) -> float:
        return time.monotonic() - self._begin

    def _elapsed(self) -> str:
        return f"{self._seconds():.1f} s"


def _complete(tape: Tape, finished: Finished) -> Watched:
    return Watched(tape.frames, tape.missing, complete=True, sentence=finished.sentence)


def _broken_off(tape: Tape, sentence: str) -> Watched:
    return Watched(tape.frames, tape.missing, complete=False, sentence=sentence)
