"""What `cablecosim paper` does, as its user sees it: a line a figure, a table at the end, and the page."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from protocol.errors import CablecosimError

from ..children import command, environment
from . import reproduce
from .figure import Figure
from .reproduce import Reproduced

WARMING: Final = "looking whether the kernels are compiled; the first time they are, for three or four minutes"


def report(names: Sequence[str], out: Path | None, kernels: str) -> int:
    """Reproduce figures by name, write `paper.json` and `paper.html`; returns the exit code, 1 where a phenomenon is missing."""
    chosen = reproduce.figures(names)
    folder = _made(out or Path("runs") / f"paper-{datetime.now():%Y%m%d-%H%M%S}")
    console = Console(highlight=False)
    begun, done = time.monotonic(), list[Reproduced]()
    with console.status(WARMING) as status:
        if kernels != "numpy":
            subprocess.run(command("shape_server", ("--warm-up",)), env=environment(), check=False, stdout=subprocess.DEVNULL)

        def show(figure: Figure) -> None:
            status.update(f"{figure.name}: {figure.title}")

        for one in reproduce.reproduce(chosen, folder, kernels, show):
            console.print(_line(one), markup=False, soft_wrap=True)
            done.append(one)
    wall = time.monotonic() - begun
    file = folder / reproduce.REPORT
    reproduce.write(file, done, wall)
    console.print(_table(done, wall))
    drawn = subprocess.run(command("viz_client", ("--paper", str(file))), env=environment(), check=False)
    if drawn.returncode:
        return drawn.returncode if drawn.returncode > 0 else 1
    return 0 if all(one.holds for one in done) else 1


def _made(folder: Path) -> Path:
    """The folder of the report, new or empty."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_empty = not any(folder.iterdir())
    except OSError as error:
        raise CablecosimError(f"{folder}: cannot be made ({error.strerror}); give another folder with --out", key=str(folder)) from error
    if not is_empty:
        raise CablecosimError(f"{folder}: is not an empty folder; give another one, for nothing is overwritten", key=str(folder))
    return folder


def _line(one: Reproduced) -> str:
    phenomena = one.result.phenomena
    held = sum(phenomenon.holds for phenomenon in phenomena)
    return f"{one.figure.name}  {one.figure.title}: {held} of {len(phenomena)} as the paper says, {one.seconds:.1f} s"


def _table(done: Sequence[Reproduced], wall: float) -> Table:
    count, held = (
        sum(len(one.result.phenomena) for one in done),
        sum(phenomenon.holds for one in done for phenomenon in one.result.phenomena),
    )
    title = f"The paper, reproduced: {held} of {count} phenomena in {wall:.0f} s"
    shown = Table(title=title, title_justify="left")
    for name in ("figure", "looked at", "the paper", "measured"):
        shown.add_column(name, overflow="fold")
    shown.add_column("")
    for one in done:
        for row, phenomenon in enumerate(one.result.phenomena):
            verdict = "[green]as said[/green]" if phenomenon.holds else "[red]not so[/red]"
            words = (one.figure.name if row == 0 else "", phenomenon.name, phenomenon.paper, phenomenon.measured)
            shown.add_row(*map(escape, words), verdict, end_section=row == len(one.result.phenomena) - 1)
    return shown
