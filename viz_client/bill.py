"""Where the time of every step of a run went, over the run: a picture of stacked areas beside the recording, with a sentence below it."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Final

from protocol import recording
from protocol.messages import Frame

from .chart import Series, stacked_over_time

FILE_NAME: Final = "bill.svg"
PARTS: Final = ("solve", "search", "robot", "encode", "wire", "wait")  # of `protocol.messages.Bill`
CROWDED: Final = 0.98  # of the steps; the axis ends where so many are whole, so that a few long ones do not press down the others


def write_bill(run: recording.Recording, file: Path) -> str:
    """Draw the bill of a run; the sentence that stands below it. Nothing is written for a run without steps that took time."""
    frames = [frame for frame in run.frames if not frame.relaxation and frame.sequence > 0]
    parts = [Series(name, [frame.time for frame in frames], [1e3 * getattr(frame.bill, name) for frame in frames]) for name in PARTS]
    spent = [one for one in parts if max(one.y, default=0.0) > 0.0]
    if not spent:
        return ""
    told = sentence(frames)
    heights = sorted(sum(values) for values in zip(*(one.y for one in parts), strict=True))
    most = heights[min(int(CROWDED * len(heights)), len(heights) - 1)]
    file.write_text(stacked_over_time(spent, told, 1.15 * max(most, 1e-3)), encoding="utf-8")
    return told


def sentence(frames: list[Frame]) -> str:
    """What the bill of some steps says in words."""
    bills = [frame.bill for frame in frames]
    whole = sum(bill.total for bill in bills)
    shares = {name: sum(getattr(bill, name) for bill in bills) for name in PARTS}
    largest = max(shares, key=lambda name: shares[name])
    longest = max(frames, key=lambda frame: frame.bill.total)
    median = 1e3 * statistics.median(bill.total for bill in bills)
    share = shares[largest] / whole if whole > 0.0 else 0.0
    why = max(PARTS, key=lambda name: float(getattr(longest.bill, name)))
    return (
        f"The median step took {median:.2g} ms. Most went to '{largest}', {share:.0%} of the {whole:.3g} s that all {len(frames)} steps "
        f"took; the longest, at {longest.time:.4g} s, took {longest.bill.total:.3g} s, most of it '{why}'."
    )
