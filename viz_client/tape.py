"""What has been recorded of a run so far: every frame once and in order, those that never came counted."""

from __future__ import annotations

from collections.abc import Callable

from protocol.codec import encode
from protocol.messages import Finished, Frame
from protocol.recording import Recording, Writer

from .painter import Painter


class Tape:
    """A recording that grows, and the pictures drawn from it.

    Attributes:
        frames: How many are recorded.
        next: Sequence number that comes next.
        missing: Sequence numbers that never came.
    """

    def __init__(self, writer: Writer, painter: Painter | None, say: Callable[[str], None], elapsed: Callable[[], str]) -> None:
        self._writer = writer
        self._painter = painter
        self._say = say
        self._elapsed = elapsed
        self.frames = self.next = self.missing = 0

    def go_on(self, before: Recording) -> None:
        """Begin where a recording was broken off, and draw its pictures anew: who was killed may have left half of one."""
        self.frames = len(before.frames)
        self.next = before.frames[-1].sequence + 1 if self.frames else 0
        self._say(f"going on with a recording of {self.frames} frames")
        for frame in before.frames:
            if frame.picture and self._painter:
                self._painter.offer(encode(frame), frame.picture)

    def keep(self, data: bytes, message: Frame | Finished) -> None:
        """Record a message, unless it came before."""
        if isinstance(message, Finished):
            self.missing += max(0, message.frames - self.next)
        elif message.sequence < self.next:
            return
        else:
            self._count(message)
        self._writer.write(data)
        if isinstance(message, Frame) and message.picture and self._painter:
            self._painter.offer(data, message.picture)

    def _count(self, frame: Frame) -> None:
        if not self.frames:
            self._say(f"first frame after {self._elapsed()}: number {frame.sequence}")
        if frame.sequence > self.next:
            self.missing += frame.sequence - self.next
            self._say(f"frames {self.next} to {frame.sequence - 1} are missing" + ("" if self.frames else ": joined late"))
        self.frames += 1
        self.next = frame.sequence + 1
