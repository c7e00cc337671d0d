"""How a run is shown while it goes: a bar on a terminal, a few plain lines anywhere else. Both go to stderr."""

from __future__ import annotations

import sys
import time
from typing import Final, Protocol, TextIO

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

LINES: Final = 10  # plain progress lines in a run


class Display(Protocol):
    """Shows a run; `close` leaves the terminal in order."""

    def say(self, sentence: str) -> None:
        """Show what is going on; the same sentence again is not repeated."""

    def step(self, step: int, steps: int, contacts: int) -> None:
        """Show how far the run is."""

    def close(self) -> None:
        """End the display."""


def display(stream: TextIO | None = None) -> Display:
    """The display that fits a stream, stderr unless given."""
    console = Console(file=stream or sys.stderr, highlight=False)
    return Bar(console) if console.is_terminal else Lines(console)


class Bar:
    """A progress bar with steps, steps per second and contacts."""

    def __init__(self, console: Console) -> None:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[note]}"),
            TimeRemainingColumn(),
        )
        self._progress = Progress(*columns, console=console)
        self._task: TaskID | None = None
        self._said = ""
        self._rate = _Rate()

    def say(self, sentence: str) -> None:
        """Print a line above the bar."""
        if sentence and sentence != self._said:
            self._progress.console.print(sentence, markup=False)
            self._said = sentence

    def step(self, step: int, steps: int, contacts: int) -> None:
        """Move the bar."""
        if self._task is None:
            self._task = self._progress.add_task("steps", total=steps, note="")
            self._progress.start()
        self._progress.update(self._task, completed=step, total=steps, note=_note(self._rate.at(step), contacts))

    def close(self) -> None:
        """Stop drawing."""
        self._progress.stop()


class Lines:
    """One line whenever another tenth of the run is done."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._said = ""
        self._tenth = -1
        self._rate = _Rate()

    def say(self, sentence: str) -> None:
        """Print a line."""
        if sentence and sentence != self._said:
            self._console.print(sentence, markup=False, soft_wrap=True)
            self._said = sentence

    def step(self, step: int, steps: int, contacts: int) -> None:
        """Print a line if another tenth is done."""
        rate = self._rate.at(step)
        tenth = LINES * step // max(1, steps)
        if tenth > self._tenth:
            self._tenth = tenth
            self.say(f"step {step} of {steps}, {_note(rate, contacts)}")

    def close(self) -> None:
        """Nothing is left to do."""


class _Rate:
    """Steps per second since the first step that was seen."""

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None

    def at(self, step: int) -> float | None:
        now = time.monotonic()
        if self._first is None:
            self._first = (step, now)
        done, passed = step - self._first[0], now - self._first[1]
        return done / passed if done > 0 and passed > 0 else None


def _note(rate: float | None, contacts: int) -> str:
    speed = "" if rate is None else f"{rate:.0f} steps/s, "
    return f"{speed}{contacts} contact{'' if contacts == 1 else 's'}"
