"""Pictures, replay page and report of a run made anew, from its recording alone."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from protocol import recording
from protocol.codec import encode

from .bill import FILE_NAME as BILL_NAME
from .bill import write_bill
from .effects import FILE_NAME as EFFECTS_NAME
from .effects import write_effects
from .painter import DIRECTORY, Painter

REPLAY_NAME = "replay.html"


def redraw(run: Path, *, replay: bool = True, pictures: bool = True, say: Callable[[str], None] = lambda _line: None) -> None:
    """Replace `pictures/`, `replay.html`, `bill.svg`, `effects.svg` and `report.html` of a run by what its recording holds.

    Args:
        run: Folder of the run.
        replay: Whether to write the pages.
        pictures: Whether to draw the key postures.
        say: Told one line for each thing done.

    Raises:
        RecordingError: If the recording has no readable beginning.
    """
    record = recording.read(run / recording.FILE_NAME)
    say(f"recording of {len(record.frames)} frames, " + ("complete" if record.complete else record.ending))
    if pictures:
        for old in (run / DIRECTORY).glob("[0-9][0-9]_*.png"):
            old.unlink()
        painter = Painter(run, drawn=lambda path: say(f"{DIRECTORY}/{path.name}"), failed=say)
        for frame in record.frames:
            if frame.picture:
                painter.offer(encode(frame), frame.picture)
        painter.finish()
    if replay:
        page(run, say)
        report(run, say)


def page(run: Path, say: Callable[[str], None]) -> None:
    """Write `replay.html`, the bill and the choice of effects from the recording, and say how large the page is and what they say."""
    from .replay import write_replay

    start = time.monotonic()
    file = run / REPLAY_NAME
    count = write_replay(run / recording.FILE_NAME, file)
    if count:
        say(f"{REPLAY_NAME}: {count} frames, {file.stat().st_size / 1e6:.1f} MB, written in {time.monotonic() - start:.1f} s")
    else:
        say(f"no {REPLAY_NAME}: the recording holds no frame")
    record = recording.read(run / recording.FILE_NAME)
    for name, write in ((BILL_NAME, write_bill), (EFFECTS_NAME, write_effects)):
        told = write(record, run / name)
        if told:
            say(f"{name}: {told}")


def report(run: Path, say: Callable[[str], None]) -> None:
    """Write `report.html`, which shows what was drawn before, and say how large it is."""
    from .report_page import write_report

    file = write_report(run)
    say(f"{file.name}: {file.stat().st_size / 1e6:.1f} MB")
