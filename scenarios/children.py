"""The programs of a run as child processes: started by name, watched, and ended by their own ids only."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from protocol.errors import CablecosimError, PeerLostError

GRACE: Final = 5.0  # s that a child may take to end after it was asked to
REFUSED: Final = 2  # exit code of a program that was given something wrong
_PR_SET_PDEATHSIG: Final = 1


class Child:
    """One program, with all that it prints in a log file."""

    def __init__(self, name: str, arguments: Sequence[str], log: Path, program: str = "") -> None:
        """Start the program of that name, or another one that goes by it."""
        self.name = name
        self.log = log
        self._begin = log.stat().st_size if log.exists() else 0  # an earlier one may have written before
        with log.open("ab") as output:
            # A session of its own, so that Ctrl-C reaches the launcher alone, which then ends all in good order.
            self._process = subprocess.Popen(
                command(program or name, arguments),
                env=environment(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_dies_with_parent(),
            )

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    @property
    def code(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self._process.poll()

    def check(self) -> None:
        """Do nothing while the child runs, or after it ended well.

        Raises:
            CablecosimError: If the program refused what it was given (exit code 2); in its own words.
            PeerLostError: Names the program, how it ended, and the last lines that it printed.
        """
        if self.code == REFUSED and self.last_words():
            raise CablecosimError(refusal(self.name, self.last_words()), key=self.name)
        if self.code:
            raise PeerLostError(self.obituary(), key=self.name)

    def obituary(self) -> str:
        """How the child ended, with its last words."""
        code, words = self.code, self.last_words()
        killed = code is not None and code < 0
        end = f"was killed by signal {-(code or 0)} ({signal_name(-(code or 0))})" if killed else f"ended with exit code {code}"
        return f"{self.name} {end}; " + (f"its last lines were:\n{textwrap.indent(words, '    ')}" if words else "it printed nothing")

    def last_words(self, count: int = 8) -> str:
        """The last lines that the child printed."""
        try:
            words = self.log.read_bytes()[self._begin :].decode(errors="replace")
        except OSError:
            return ""
        return "\n".join(words.rstrip().splitlines()[-count:])

    def wait(self, timeout: float) -> bool:
        """Whether the child has ended within `timeout` seconds."""
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def terminate(self) -> None:
        """Ask the child to end, without waiting."""
        if self.code is None:
            self._process.terminate()

    def kill(self) -> None:
        """End the child at once."""
        if self.code is None:
            self._process.kill()
            self._process.wait()


def command(name: str, arguments: Sequence[str]) -> list[str]:
    """The command that starts one of our programs; -P, so that a folder called protocol where the user is does no harm."""
    return [sys.executable, "-P", "-m", name, *arguments]


def run_to_its_end(name: str, arguments: Sequence[str], message: bytes | None = None) -> int:
    """Exit code of a program that is given a message and prints to the terminal; 1 if a signal ended it."""
    done = subprocess.run(command(name, arguments), input=message, env=environment(), check=False)
    return done.returncode if done.returncode >= 0 else 1


def environment() -> dict[str, str]:
    """The environment of a child: ours, and the very packages that we were imported from."""
    paths = [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")]
    # Matrices here are small: a second thread of BLAS costs more than it saves, and the other programs need the core.
    return {"OPENBLAS_NUM_THREADS": "1", **os.environ, "PYTHONPATH": os.pathsep.join(path for path in paths if path)}


def refusal(name: str, words: str) -> str:
    """The sentence with which a program refused: the last line that carries its name, and what follows."""
    before, mark, sentence = words.rpartition(f"{name}: ")
    return sentence if mark and (not before or before.endswith("\n")) else words


def end_all(children: Sequence[Child], grace: float = GRACE) -> None:
    """End every child: asked at first, killed after `grace` seconds."""
    for child in children:
        child.terminate()
    end = time.monotonic() + grace
    for child in children:
        child.wait(max(0.0, end - time.monotonic()))
        child.kill()


def signal_name(number: int) -> str:
    """What a signal is called."""
    try:
        name = signal.Signals(number).name
    except ValueError:
        return "unknown"
    return f"{name}, a segmentation fault" if number == signal.SIGSEGV else name


def _dies_with_parent() -> Callable[[], object] | None:
    """What a child does first: ask Linux for a SIGTERM when its parent dies, even by SIGKILL."""
    if sys.platform != "linux":
        return None
    libc = ctypes.CDLL(None)
    return lambda: libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
