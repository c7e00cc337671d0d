"""Which settings no other one beats in both error and time, and what ten times the accuracy costs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from .study import AUTOMATIC, Row, Studied

ROUNDING: Final = 1e-10  # over the length; errors below are rounding
SHOWN: Final = 4  # errors that a sentence names at most
LEFT_OUT: Final = "effect left out"


def frontier(rows: Iterable[Row]) -> list[Row]:
    """Rows from coarse to fine, each of which is the fastest of all that are as exact."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (row.seconds, row.error)):
        if not best or row.error < best[-1].error:
            best.append(row)
    return best


def price_of_ten(rows: Sequence[Row]) -> float | None:
    """Factor on the time for a tenth of the error, along rows of one group; None if they span less than a factor of ten.

    The mean slope in logarithms of the line of least squares.
    """
    points = sorted({(math.log10(max(row.error, ROUNDING)), math.log10(row.seconds)) for row in rows})
    errors, times = [x for x, _ in points], [y for _, y in points]
    if not points or errors[-1] - errors[0] < 1.0:
        return None
    mean_error, mean_time = sum(errors) / len(errors), sum(times) / len(times)
    square = sum((x - mean_error) ** 2 for x in errors)
    slope = sum((x - mean_error) * (y - mean_time) for x, y in points) / square
    return float(10.0**-slope)


def sentence(studied: Studied) -> str:
    """What a plot shows."""
    automatic = [row for row in studied.rows if row.group == AUTOMATIC]
    if not automatic:
        return "No tolerance gave a shape."
    coarse, fine = max(automatic, key=lambda row: row.error), min(automatic, key=lambda row: row.error)
    price = price_of_ten(automatic)
    if price is None:
        fast, slow = (_time(pick(row.seconds for row in automatic)) for pick in (min, max))
        text = (
            f"Every tolerance gives {fine.error:.0e} to {coarse.error:.0e} of the length, in {fast} to {slow}: "
            "there is not ten times the accuracy to buy."
        )
    else:
        text = (
            f"From {coarse.error:.0e} to {fine.error:.0e} of the length takes {_time(coarse.seconds)} to {_time(fine.seconds)}: "
            f"ten times the accuracy costs {price:.2f} times the time."
        )
    held = sum(row.error <= max(row.estimate, ROUNDING) for row in automatic)
    text += f" The estimate held in {held} of {len(automatic)} answers asked for by tolerance."
    for name in studied.peers:
        rows = [row for row in studied.rows if row.group == name]
        own = [row for row in studied.rows if row.group not in studied.peers]
        text += f" {_against(name, rows, own)}" if rows else f" {name} lost the cable at every setting."
    for why in studied.missing:
        text += f" {why}"
    worst = max((row for row in studied.rows if row.group == LEFT_OUT), key=lambda row: row.error, default=None)
    if worst is not None:
        text += f" What matters most here: {worst.setting} the shape is {worst.error:.1%} of the length off."
    return text


def _time(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 1.0 else f"{1e3 * seconds:.2g} ms"


def _against(name: str, peer: Sequence[Row], own: Sequence[Row]) -> str:
    """How many times as long a peer takes as the fastest of ours that is as exact, at the errors that it reaches."""
    ratios = [
        (row.error, row.seconds / min((one.seconds for one in own if one.error <= row.error), default=math.inf)) for row in frontier(peer)
    ]
    known = [(error, ratio) for error, ratio in ratios if ratio > 0.0]
    if not known:
        return f"{name} is more exact than any answer here."
    shown = known if len(known) <= SHOWN else [known[0], known[len(known) // 2], known[-1]]
    times = ", ".join(f"{ratio:.3g} at {error:.0e}" for error, ratio in shown)
    return f"{name} takes {times} times as long as our fastest that is as exact."
