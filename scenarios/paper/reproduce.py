"""Runs the takes of the paper's figures in the three programs, two at a time, and measures each figure from its recordings.

`paper.json` holds for every figure the claim, what was measured and the curves of its panels; `viz_client` makes the page of it. The
recordings stay beside it, one folder a take.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from threading import Event
from typing import Any, Final

import numpy as np

from protocol.errors import CablecosimError

from ..launch import launch
from ..load import load
from ..spelling import meant
from . import MODULES
from .figure import Figure, Phenomenon, Result, Screenshot, Take
from .recorded import Recorded, open_take

REPORT: Final = "paper.json"
TAKES: Final = "takes"  # folder of the recordings
JOBS_MAX: Final = 2  # a run keeps one core busy, for its programs mostly wait for each other


@dataclass(frozen=True)
class Reproduced:
    """A figure with what was measured and how long its takes took."""

    module: str
    figure: Figure
    result: Result
    seconds: float
    files: tuple[str, ...] = ()  # of the screenshots, from the folder of the report on

    @property
    def holds(self) -> bool:
        """Whether every phenomenon is as the paper says."""
        return all(phenomenon.holds for phenomenon in self.result.phenomena)


def figures(names: Sequence[str]) -> dict[str, Figure]:
    """Figures by module, in the order of the paper: all, or those named.

    Raises:
        CablecosimError: If there is no such figure.
    """
    known = {name: module for module, own in MODULES.items() for name in own}
    for name in names:
        if name not in known:
            close = meant(name, list(known))
            hint = f"did you mean '{close}'?" if close else "there are"
            raise CablecosimError(f"figure '{name}' unknown; {hint} {', '.join(known)}", key=name)
    chosen = {known[name] for name in names} if names else set(MODULES)
    return {module: import_module(f".{module}", __package__).FIGURE for module in MODULES if module in chosen}


def reproduce(chosen: dict[str, Figure], out: Path, kernels: str, begun: Callable[[Figure], None]) -> Iterator[Reproduced]:
    """Run and measure figures one after the other; ended early, the programs are ended in good order."""
    with _takes(chosen, out, kernels) as running:
        for module, figure in chosen.items():
            begun(figure)
            yield _measured(module, figure, running[module], out)


def write(report: Path, done: Iterable[Reproduced], wall: float) -> None:
    """Write what was measured as JSON."""
    content = {"seconds": round(wall, 1), "figures": [_as_json(one) for one in done]}
    report.write_text(json.dumps(content, ensure_ascii=False, allow_nan=False, default=np.generic.item) + "\n", encoding="utf-8")


@contextmanager
def _takes(chosen: dict[str, Figure], out: Path, kernels: str) -> Iterator[dict[str, list[Future[float]]]]:
    """All takes under way, each giving its seconds."""
    stop = Event()
    jobs = min(JOBS_MAX, len(os.sched_getaffinity(0)))
    with ThreadPoolExecutor(jobs) as pool:
        try:
            yield {
                module: [pool.submit(_run, take, _folder(out, module, take), kernels, stop) for take in figure.takes]
                for module, figure in chosen.items()
            }
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _run(take: Take, folder: Path, kernels: str, stop: Event) -> float:
    begun = time.monotonic()
    launch(load(take.scene, take.settings), take.name, Silent(stop), out=folder, kernels=kernels, replay=False, pictures=take.pictures)
    return time.monotonic() - begun


def _folder(out: Path, module: str, take: Take) -> Path:
    return out / TAKES / f"{module}-{take.name}"


def _measured(module: str, figure: Figure, running: Sequence[Future[float]], out: Path) -> Reproduced:
    seconds, recordings = 0.0, dict[str, Recorded]()
    try:
        for take, future in zip(figure.takes, running, strict=True):
            seconds += future.result()
            recordings[take.name] = open_take(take.name, _folder(out, module, take))
        result = figure.measure(recordings)
        files = tuple(_file(recordings[one.take], one, out) for one in result.screenshots)
    except CablecosimError as error:
        failed = Phenomenon("the run", "comes to its end", str(error), holds=False)
        return Reproduced(module, figure, Result((failed,), differs=""), seconds)
    return Reproduced(module, figure, result, seconds, files)


def _as_json(done: Reproduced) -> dict[str, Any]:
    figure, result = done.figure, done.result
    return {
        "name": figure.name,
        "module": done.module,
        "title": figure.title,
        "claim": figure.claim,
        "holds": done.holds,
        "seconds": round(done.seconds, 1),
        "takes": [{"name": take.name, "scene": take.scene, "settings": take.settings} for take in figure.takes],
        "phenomena": [asdict(phenomenon) for phenomenon in result.phenomena],
        "differs": result.differs,
        "panels": [asdict(panel) for panel in result.panels],
        "screenshots": [{"caption": one.caption, "file": file} for one, file in zip(result.screenshots, done.files, strict=True)],
        "procedure": figure.procedure,
    }


def _file(recorded: Recorded, screenshot: Screenshot, out: Path) -> str:
    """Path of a drawn key posture, from the folder of the report on; pictures are numbered in the order of the run."""
    drawn = [frame.picture for frame in recorded.frames if frame.picture]
    number = drawn.index(screenshot.picture) + 1 if screenshot.picture in drawn else 0
    files = list(recorded.folder.glob(f"pictures/{number:02d}_*.png"))
    if not files:
        raise CablecosimError(f"take '{recorded.name}' has no picture '{screenshot.picture}'; there are {drawn}", key=screenshot.picture)
    return str(files[0].relative_to(out))


class Silent:
    """Shows nothing of a run, and interrupts it once when asked to stop."""

    def __init__(self, stop: Event) -> None:
        self._stop, self._has_stopped = stop, False

    def say(self, sentence: str) -> None:
        """Look whether to stop."""
        if self._stop.is_set() and not self._has_stopped:
            self._has_stopped = True
            raise KeyboardInterrupt

    def step(self, step: int, steps: int, contacts: int) -> None:
        """Look whether to stop."""
        self.say("")

    def close(self) -> None:
        """Nothing is left to do."""
