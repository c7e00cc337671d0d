"""What a run came to, as one page that opens offline: the verdict, the key postures, curves over time, and where the time went."""

from __future__ import annotations

import base64
import html
from collections import Counter
from pathlib import Path
from typing import Final

from protocol import recording

from .chart import over_time
from .history import History, Panel, cables_of, history
from .page_style import STYLE
from .painter import DIRECTORY

FILE_NAME: Final = "report.html"
DRAWINGS: Final = ("effects.svg", "bill.svg")  # drawn beside the recording, shown here too
GOOD, BAD = "ok", "not"  # classes of `STYLE`


def write_report(run: Path) -> Path:
    """Write `report.html` of a run folder from its recording, and what was drawn of it already.

    Raises:
        RecordingError: If the recording has no readable beginning.
    """
    record = recording.read(run / recording.FILE_NAME)
    found, scene = history(record), record.snapshot.scene
    title = html.escape(scene.title)
    panels = "".join(_panel(panel, found) for panel in found.panels)
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>"
        f'<p class="lead">{html.escape(cables_of(scene.cables))}. {_surroundings(record)}. '
        '<a href="replay.html">Every step in three dimensions</a>.</p>'
        f"{_verdict(record)}{_postures(run)}"
        f'<section><h2>Over the run</h2><div class="panels two">{panels}</div></section>'
        f"{_drawings(run)}{_versions(record)}</body></html>\n"
    )
    file = run / FILE_NAME
    unfinished = run / f".{FILE_NAME}"
    unfinished.write_text(page, encoding="utf-8")
    return unfinished.replace(file)


def _surroundings(record: recording.Recording) -> str:
    bodies, joints = len(record.snapshot.scene.bodies), len(record.snapshot.joints)
    return f"{bodies or 'No'} bod{'y' if bodies == 1 else 'ies'}, {f'a robot with {joints} joints' if joints else 'no robot'}"


def _verdict(record: recording.Recording) -> str:
    """Whether all went well, in words; what spoils it first."""
    shapes = Counter(shape.outcome.value for frame in record.frames for shape in frame.shapes)
    solved = [frame for frame in record.frames if not frame.relaxation]
    bad = []
    if record.finished is None or record.finished.failed:
        bad.append(record.finished.sentence if record.finished is not None else "the recording breaks off before the end of the run")
    others = sum(shapes.values()) - shapes["converged"]
    if others:
        bad.append(f"{others} of {sum(shapes.values())} shapes did not converge")
    hit = sum(bool(frame.collisions) for frame in solved)
    if hit:
        bad.append(f"robot and bodies collide in {hit} step{'s' if hit > 1 else ''}")
    snaps = len(record.frames) - len(solved)
    done = f"{max(0, len(solved) - 1)} of {record.snapshot.steps} steps"
    if not others:
        done += ", every shape converged"
    if snaps:
        done += f"; {snaps} frame{'s' if snaps > 1 else ''} in between: an artificial motion from one equilibrium to another"
    lines = [f'<span class="{BAD}">&#10007; {html.escape(one)}</span>' for one in bad]
    lines.append(f'<span class="{"" if bad else GOOD}">{"" if bad else "&#10003; "}{done}</span>')
    return f'<p class="claim"><b>how it ended</b>{"<br>".join(lines)}</p>'


def _postures(run: Path) -> str:
    """The key postures, in the order in which they were taken."""
    pictures = sorted((run / DIRECTORY).glob("[0-9]*.png"))
    if not pictures:
        return ""
    shown = "".join(_picture(file) for file in pictures)
    return f'<section><h2>Key postures</h2><div class="panels">{shown}</div></section>'


def _picture(file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    name = html.escape(file.stem.partition("_")[2].replace("_", " ") or file.stem)
    return f'<figure><img alt="{name}" src="data:image/png;base64,{data}"><figcaption>{name}</figcaption></figure>'


def _panel(panel: Panel, found: History) -> str:
    return f"<figure>{over_time(panel, found)}<figcaption>{html.escape(panel.sentence)}</figcaption></figure>"


def _drawings(run: Path) -> str:
    """What other files of the run show; each has its sentence in it."""
    shown = [file.read_text(encoding="utf-8") for name in DRAWINGS if (file := run / name).is_file()]
    return "".join(f"<section><figure>{drawing}</figure></section>" for drawing in shown)


def _versions(record: recording.Recording) -> str:
    words = ", ".join(f"{name} {number}" for name, number in record.snapshot.versions.items())
    return (
        '<section><p class="how">summary.json has these figures for a program, recording.msgpack all that was sent. '
        f"Made with {html.escape(words)}.</p></section>"
    )
