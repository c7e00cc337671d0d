"""How hard cases ended, as a table, family by family, and as JSON."""

from __future__ import annotations

import json
import math
import statistics
import sys
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from protocol.hard_case import Ending

from .hard_cases import Listed, Result

HEAD: Final = ("family", "cases", "right", "refused", "outside", "wrong", "known", "worst error", "median s", "worst s", "worst/median")


def table(results: Sequence[Result]) -> str:
    """One row a family and one for all; below it every case that is wrong, with its sentence.

    "wrong" counts what was not known to be wrong; "known" what was. The worst error is that of the cases that are right, over their
    tolerance: below one.
    """
    families = list(dict.fromkeys(result.case.family for result in results))
    rows = [HEAD, *(_row(family, [one for one in results if one.case.family == family]) for family in families)]
    if len(families) > 1:
        rows.append((*_row("all", results)[:-1], ""))
    return "\n".join([*aligned(rows), *_wrong(results)])


def aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """A line a row, the first column to the left and the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]) for row in rows
    ]


def gathered(cases: Sequence[Listed], results: Iterable[Result]) -> list[Result]:
    """The results of all these cases, told as they come in."""
    found: list[Result] = []
    for result in results:
        found.append(result)
        progress(cases, len(found))
    return found


def _row(family: str, results: Sequence[Result]) -> tuple[str, ...]:
    count = {ending: sum(one.verdict.ending is ending for one in results) for ending in Ending}
    known = sum(one.verdict.ending is Ending.WRONG and bool(one.case.known) for one in results)
    errors = [one.verdict.error for one in results if one.verdict.ending is Ending.RIGHT]
    seconds = [one.seconds for one in results]
    median = statistics.median(seconds)
    return (
        family,
        str(len(results)),
        *(str(count[ending]) for ending in (Ending.RIGHT, Ending.REFUSED, Ending.OUTSIDE)),
        str(count[Ending.WRONG] - known),
        str(known),
        f"{max(errors):.2g}" if errors else "-",
        f"{median:.3f}",
        f"{max(seconds):.2f}",
        f"{max(seconds) / max(median, 1e-9):.0f}",
    )


def _wrong(results: Iterable[Result]) -> Iterable[str]:
    for one in results:
        if one.is_silent and one.case.known:
            yield f"known to be wrong, and {one.verdict.ending.value} now: {one.case.family}: {one.case.name}"
        elif one.is_silent:
            yield f"WRONG {one.case.family}: {one.case.name}: {one.verdict.sentence}"
        elif one.case.known:
            yield f"known {one.case.family}: {one.case.name}: {one.case.known}"


def progress(cases: Sequence[Listed], done: int) -> None:
    """Say how many cases are done: in a terminal on one line that overwrites itself, elsewhere at the end of each family."""
    family, is_last = cases[done - 1].family, done == len(cases)
    text = f"{done}/{len(cases)} {family}"
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{text:60s}" + ("\r" + " " * 60 + "\r" if is_last else ""))
    elif is_last or cases[done].family != family:
        sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def as_json(results: Iterable[Result], peers: Mapping[str, Iterable[Result]] = MappingProxyType({})) -> str:
    """Every case with its ending, error over tolerance (null if there is none), seconds and sentence, and the same of every peer asked."""
    theirs = {name: {one.case: _ended(one) for one in answers} for name, answers in peers.items()}
    rows: list[dict[str, Any]] = [
        {
            "family": one.case.family,
            "name": one.case.name,
            **_ended(one),
            "known": one.case.known,
            **({"peers": {name: ended[one.case] for name, ended in theirs.items() if one.case in ended}} if theirs else {}),
        }
        for one in results
    ]
    return json.dumps(rows, indent=1) + "\n"


def _ended(result: Result) -> dict[str, Any]:
    return {
        "ending": result.verdict.ending.value,
        "error": result.verdict.error if math.isfinite(result.verdict.error) else None,
        "seconds": result.seconds,
        "sentence": result.verdict.sentence,
    }
