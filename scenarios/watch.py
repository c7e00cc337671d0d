"""Signs of life of the two programs that the launcher does not talk to: the shape server's, told by the environment, and the recorder's.

The recorder's sign of life is its recording, which grows with every frame. One that does not grow, though there are frames that it has
not got, has a recorder that hangs.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from protocol import recording
from protocol.errors import RecordingError
from protocol.messages import Statistics

from .keeper import AUDITOR, Keeper

FIRST: Final = 20.0  # s for a recorder to begin its recording
COMPILING: Final = 300.0  # s for a shape server to be there, with every kernel compiled
LISTENING: Final = "shape server listening at"  # what it prints when it is ready


class Watch:
    """Replaces a shape server or a recorder that gives no sign of life."""

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper
        self._file: Path | None = None
        self._step = -1
        self._size, self._grown, self._step_then = -1, time.monotonic(), -1
        self._listening = 0.0  # s, when the shape server was first seen to listen; 0 if it was not

    def follow(self, folder: Path) -> None:
        """Watch the recording of a folder too, from now on."""
        self._file, self._grown = folder / recording.FILE_NAME, time.monotonic()

    def look(self, state: Statistics | None) -> None:
        """Compare with what the environment says; with None it has ended, and the recorder has all that it will get.

        Raises:
            PeerLostError: If one of them has been replaced too often.
        """
        if state is not None:
            if state.step > self._step:
                self._step = state.step
                self._keeper.got_on("shape_server", "env_server", *({AUDITOR} & self._keeper.names))
            self._look_at_shape_server(state)
        if self._file is not None:
            self._look_at_recorder(self._file, is_over=state is None or state.state in ("finished", "failed"))

    def _look_at_shape_server(self, state: Statistics) -> None:
        name, silence = "shape_server", self._keeper.silence
        now, is_listening = time.monotonic(), LISTENING in self._keeper.child(name).last_words()
        if not is_listening:
            self._listening = 0.0
        elif not self._listening:
            self._listening = now
        waited = now - self._listening if self._listening else self._keeper.age(name) - COMPILING
        if state.silent > silence and waited > silence:
            self._keeper.replace(name, f"gave no sign of life for {silence:g} s")
            self._listening = 0.0

    def _look_at_recorder(self, file: Path, *, is_over: bool) -> None:
        name, now = "viz_client", time.monotonic()
        size = file.stat().st_size if file.exists() else -1
        if size > self._size:
            self._size, self._grown, self._step_then = size, now, self._step
            self._keeper.got_on(name)
        if self._keeper.child(name).code is not None:
            return
        silence = self._keeper.silence if size > 0 else max(FIRST, self._keeper.silence)
        is_behind = size <= 0 or self._step > self._step_then or is_over
        if not is_behind or min(now - self._grown, self._keeper.age(name)) <= silence:
            return
        if _is_complete(file):
            self._file = None  # from here on it draws
            return
        self._keeper.replace(name, f"recorded nothing for {silence:g} s")
        self._grown = now


def _is_complete(file: Path) -> bool:
    try:
        return recording.read(file).complete
    except RecordingError:
        return False
