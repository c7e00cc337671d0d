"""Runs the hard cases of all programs, each program in processes of its own that are killed when a case hangs or crashes.

The shape server has cases of one request; the environment has cases that take bodies and steps, for which it asks a shape server.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from protocol.errors import CablecosimError
from protocol.hard_case import READY, Ending, Verdict

from .children import Child, command, end_all, environment

HOLDERS: Final = ("shape_server", "env_server")  # programs that have cases
PEERED: Final = "shape_server"  # the program whose cases other programs can be asked for
PREPARING: Final = 600.0  # s for a program to be ready, which may have to compile
LIMIT: Final = {"compiled": 60.0, "numpy": 600.0}  # s for a case
PATIENCE: Final = 20.0  # s for another program and a case
INFINITE: Final = float("inf")


@dataclass(frozen=True)
class Listed:
    """A case as its program names it."""

    program: str
    number: int
    family: str
    name: str
    is_slow: bool
    known: str


@dataclass(frozen=True)
class Result:
    """What a case ended in, after how many seconds."""

    case: Listed
    verdict: Verdict
    seconds: float

    @property
    def is_silent(self) -> bool:
        """Wrong without that being known, or known as wrong and right now: in either case the catalogue has to change."""
        return (self.verdict.ending is Ending.WRONG) != bool(self.case.known)


def listed(family: str | None = None) -> tuple[Listed, ...]:
    """All cases, or those of one family, in the order in which they are run.

    Raises:
        CablecosimError: If there is no such family.
    """
    cases: list[Listed] = []
    for program in HOLDERS:
        with subprocess.Popen(_words(program, ()), env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            names = json.loads(process.stdout.readline() or b"null")
        if names is None:
            raise CablecosimError(f"{program} names no cases; it ended with exit code {process.returncode}", key=program)
        cases += [Listed(program=program, number=number, **fields) for number, fields in enumerate(names)]
    families = list(dict.fromkeys(case.family for case in cases))
    if family not in (None, *families):
        raise CablecosimError(f"family '{family}' unknown; there are {', '.join(map(repr, families))}", key="family")
    return tuple(case for case in cases if family in (None, case.family))


def peers(wanted: Sequence[str] = ()) -> tuple[str, ...]:
    """The other programs that are installed, or those of them that are wanted.

    Raises:
        CablecosimError: If one is wanted that is not there.
    """
    said = subprocess.run(_words(PEERED, ("--peers",)), env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, check=True)
    installed = tuple(json.loads(said.stdout))
    for name in wanted:
        if name not in installed:
            raise CablecosimError(f"peer '{name}' is not installed; there are {', '.join(map(repr, installed))}", key="peers")
    return tuple(wanted) or installed


def ask(peer: str, cases: Iterable[Listed], kernels: str) -> Iterator[Result]:
    """What another program makes of the cases that can be handed on; ended where it takes longer than `PATIENCE`."""
    return run([case for case in cases if case.program == PEERED], kernels, PATIENCE, peer)


def run(cases: Iterable[Listed], kernels: str, limit: float | None = None, peer: str | None = None) -> Iterator[Result]:
    """Results in the order of the cases.

    Args:
        cases: As `listed`.
        kernels: "auto", "compiled" or "numpy".
        limit: [s] After this a case counts as hanging; a minute unless given, ten for numpy.
        peer: Who is asked for the cases in place of the program itself.
    """
    worker: _Worker | None = None
    try:
        for case in cases:
            if worker is not None and worker.program != case.program:
                worker.close()
                worker = None
            worker = worker or _Worker(case.program, kernels, peer)
            begun = time.perf_counter()
            patience = limit if limit is not None else LIMIT[worker.kernels]
            answer = worker.ask(str(case.number), patience)
            if answer is not None:
                error = INFINITE if answer["error"] is None else answer["error"]
                yield Result(case, Verdict(Ending(answer["ending"]), error, answer["sentence"]), answer["seconds"])
            else:
                verdict = Verdict(Ending.WRONG, INFINITE, worker.obituary(patience))
                worker.close()
                worker = None
                yield Result(case, verdict, time.perf_counter() - begun)
    finally:
        if worker is not None:
            worker.close()


def _words(program: str, arguments: Sequence[str]) -> list[str]:
    return command(f"{program}.hard_cases", arguments)


class _Worker:
    """A process that has everything ready, and waits for numbers of cases."""

    def __init__(self, program: str, kernels: str, peer: str | None) -> None:
        self.program = program
        self._folder = tempfile.TemporaryDirectory(prefix="cc-")
        self._server: Child | None = None
        words: tuple[str, ...] = ("--kernels", kernels)
        if program == "env_server":
            address = f"ipc://{self._folder.name}/shape"
            self._server = Child("shape_server", ("--bind", address, *words), Path(self._folder.name) / "shape_server.log")
            words = ("--shape", address)
        if peer is not None:
            words = (*words, "--peer", peer)
        self._process = subprocess.Popen(
            _words(program, words),
            env=environment(),
            cwd=self._folder.name if peer is not None else None,  # some write a log where they are
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        self._read(PREPARING)  # the names
        self.kernels = self.ask(READY, PREPARING)
        if self.kernels is None:
            sentence = self.obituary(PREPARING)
            self.close()
            raise CablecosimError(f"{program} does not get ready for its cases: {sentence}", key=program)

    def ask(self, line: str, limit: float) -> Any:
        """The answer to a line; None where the process hangs or has died."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(line.encode() + b"\n")
            self._process.stdin.flush()
        return self._read(limit)

    def obituary(self, limit: float) -> str:
        """How the process ended, or that it had to be."""
        with suppress(subprocess.TimeoutExpired):
            code = self._process.wait(0.5)
            return f"the process died with exit code {code}"
        return f"no answer within {limit:g} s, and so it was ended"

    def close(self) -> None:
        """End the process, and the shape server that it asks, at once."""
        if self._process.poll() is None:
            os.kill(self._process.pid, signal.SIGKILL)
        self._process.communicate()
        if self._server is not None:
            end_all([self._server])
        self._folder.cleanup()

    def _read(self, limit: float) -> Any:
        """The next line that the process writes; None if none comes."""
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], limit)[0]:
            return None
        line = self._process.stdout.readline()
        return json.loads(line) if line.endswith(b"\n") else None
