"""Runs cases in a process of its own, which is killed when one hangs or crashes; the next case gets a new one."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from .case import Case, Ending, Verdict


@dataclass(frozen=True)
class Result:
    """What a case ended in, after how many seconds."""

    case: Case
    verdict: Verdict
    seconds: float

    @property
    def is_silent(self) -> bool:
        """Wrong without that being known, or known as wrong and right now: in either case the catalogue has to change."""
        return (self.verdict.ending is Ending.WRONG) != bool(self.case.known)


def run(cases: Iterable[Case], kernels: str, limit: float) -> Iterator[Result]:
    """Results in the order of the cases.

    Args:
        cases: Named as in the catalogue.
        kernels: "compiled" or "numpy".
        limit: [s] After this a case counts as hanging.
    """
    worker: _Worker | None = None
    try:
        for case in cases:
            worker = worker or _Worker(kernels)
            begun = time.perf_counter()
            verdict, seconds = worker.ask(case, limit) or (None, time.perf_counter() - begun)
            if verdict is None:
                worker.kill()
                verdict = Verdict(Ending.WRONG, np.inf, worker.obituary(limit))
                worker = None
            yield Result(case, verdict, seconds)
    finally:
        if worker is not None:
            worker.kill()


class _Worker:
    """A process that has the kernels ready, and waits for names of cases."""

    def __init__(self, kernels: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, kernels), daemon=True)
        self._process.start()
        theirs.close()
        self._ours.recv()  # ready

    def ask(self, case: Case, limit: float) -> tuple[Verdict, float] | None:
        """The verdict and its seconds; None where the process hangs or has died."""
        try:
            self._ours.send((case.family, case.name))
            if not self._ours.poll(limit):
                return None
            verdict, seconds = self._ours.recv()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._process.join(1.0)
            return None
        return verdict, seconds

    def obituary(self, limit: float) -> str:
        """How the process ended."""
        code = self._process.exitcode
        return (
            f"no answer within {limit:g} s, and so it was ended" if code == -signal.SIGKILL else f"the process died with exit code {code}"
        )

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()
        self._ours.close()


def _serve(channel: Connection, kernels: str) -> None:
    """Answer names of cases until the other end closes."""
    from ..paths import Paths
    from .catalogue import catalogue, family_names, warm_up

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asked decides when to end
    path = Paths(kernels).current
    warm_up(path)
    known = {(case.family, case.name): case for name in family_names() for case in catalogue(name)}
    channel.send("ready")
    while True:
        try:
            case = known[channel.recv()]
        except EOFError:
            return
        begun = time.perf_counter()
        verdict = case.run(path)
        channel.send((verdict, time.perf_counter() - begun))
