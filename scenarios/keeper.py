"""Keeps the programs of a run going: one that is killed from outside, or gives no sign of life, is started again.

A program that ends by itself, with a sentence or by a fault of its own, would do so again, so that is where the run ends. So
does one that has been started again RESTARTS_MAX times without getting on in between. Only programs started here are ended, by their ids.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from protocol.errors import PeerLostError

from .children import Child

SILENCE: Final = 20.0  # s without a sign of life after which a program is ended and started again
RESTARTS_MAX: Final = 3  # of one program without getting on in between
FROM_OUTSIDE: Final = {-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, -signal.SIGHUP, -signal.SIGQUIT}
"""Exit codes of a program that somebody ended; a fault of its own has another signal."""
AUDITOR: Final = "auditor"  # a second shape server, for audits
SERVES: Final = {"shape_server", AUDITOR}  # never end by themselves


@dataclass
class _Kept:
    """A program, with how it is started."""

    child: Child
    arguments: Sequence[str]
    again: Sequence[str]  # arguments when it is started again
    begun: float  # s, when it was started last
    program: str  # what goes by the name
    restarts: int = 0  # since it last got on


class Keeper:
    """The programs of one run, by name.

    Args:
        box: Folder for their logs.
        say: Told what was started again and why.
        silence: [s] Without a sign of life after which a program is ended.
    """

    def __init__(self, box: Path, say: Callable[[str], None], silence: float) -> None:
        self._box = box
        self._say = say
        self._kept: dict[str, _Kept] = {}
        self._is_over = False
        self.silence = silence

    @property
    def children(self) -> list[Child]:
        """Every program as it was started last."""
        return [kept.child for kept in self._kept.values()]

    @property
    def names(self) -> set[str]:
        """Of every program that was started."""
        return set(self._kept)

    def child(self, name: str) -> Child:
        """The program of that name, as it was started last."""
        return self._kept[name].child

    def start(self, name: str, arguments: Sequence[str], again: Sequence[str] | None = None, program: str = "") -> None:
        """Start a program.

        Args:
            name: Of its package, or what it goes by.
            arguments: Of its command line.
            again: The same when it has to be started again, if they differ.
            program: Of its package, if it goes by another name.
        """
        child = Child(name, arguments, self._box / f"{name}.log", program)
        self._kept[name] = _Kept(child, arguments, arguments if again is None else again, time.monotonic(), program)

    def age(self, name: str) -> float:
        """Seconds since a program was started last."""
        return time.monotonic() - self._kept[name].begun

    def got_on(self, *names: str) -> None:
        """Take note that these programs have got on with the run."""
        for name in names:
            self._kept[name].restarts = 0

    def let_end(self) -> None:
        """Start nothing again from now on."""
        self._is_over = True

    def mend(self) -> set[str]:
        """Start again whatever was killed from outside; the names.

        Raises:
            CablecosimError: If a program refused what it was given; in its own words.
            PeerLostError: If a program ended otherwise than well, or has been started again too often; with its last words.
        """
        mended = set()
        for name, kept in self._kept.items():
            code = kept.child.code  # asked once: it may end at any time
            if (code in FROM_OUTSIDE or (code == 0 and name in SERVES)) and not self._is_over:
                self._start_again(name, kept.child.obituary().partition(";")[0])
                mended.add(name)
            elif code is not None:
                kept.child.check()
        return mended

    def replace(self, name: str, why: str) -> bool:
        """End a program that gives no sign of life, and start it again; False if nothing is to be started again.

        Raises:
            PeerLostError: If it has been started again too often.
        """
        if self._is_over:
            return False
        self._kept[name].child.kill()
        self._start_again(name, f"{name} {why}")
        return True

    def _start_again(self, name: str, why: str) -> None:
        kept = self._kept[name]
        if kept.restarts == RESTARTS_MAX:
            words = kept.child.obituary()
            raise PeerLostError(f"{why}, after it had been started again {RESTARTS_MAX} times without getting on; {words}", key=name)
        self._say(f"{why}; it is started again")
        kept.restarts += 1
        kept.begun = time.monotonic()
        kept.child = Child(name, kept.again, self._box / f"{name}.log", kept.program)
