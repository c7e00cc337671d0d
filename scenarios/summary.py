"""What a run came to, computed from its recording alone: `summary.json` and the table on the terminal.

A step is one frame after the first, which shows the start posture. Forces, curvatures and error estimates are taken from
shapes that converged; how many did not stands in `outcomes`. What a recording cannot say is null, never zero.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from protocol import recording
from protocol.kinds import Outcome, SelfInteraction
from protocol.messages import Bill, Frame, Shape
from protocol.scene import Scene

from .passing import distance
from .timeline import Timeline, sentences

if TYPE_CHECKING:
    from rich.table import Table

FILE_NAME: Final = "summary.json"
BILL: Final = Bill.__struct_fields__

TOUCHING: Final = (SelfInteraction.CONTACT, SelfInteraction.BOND)
WARM_UP: Final = 10  # steps left out of the speed, in which kernels are loaded

Summary = dict[str, Any]


def summarise(run: recording.Recording, *, wall: float | None = None) -> Summary:
    """The summary of a run, whole or broken off.

    Args:
        run: What its recording holds.
        wall: [s] Wall time from the command to the last file written, which the recording does not know.

    Returns:
        Plain values with their units in the names. `steps_per_second` is the number of steps over the sum of their bills'
        totals, without the first `WARM_UP` steps and without what was held by pauses; hard steps count in full.
    """
    tally, timeline = _Tally(), Timeline(run.snapshot.scene)
    for frame in run.frames:
        if frame.relaxation:  # what is shown on the way from one equilibrium to the next was not solved
            tally.between += 1
        else:
            tally.add(frame, run.snapshot.scene)
            timeline.add(frame)
    finished = run.finished
    return {
        "scene": run.snapshot.scene.title,
        "complete": finished is not None and not finished.failed,
        "sentence": finished.sentence if finished is not None else "the recording breaks off before the end of the run",
        "steps": max(0, tally.frames - 1),
        "steps_planned": run.snapshot.steps,
        "wall_s": wall,
        **tally.values(),
        "effects": timeline.values(),
        "versions": dict(run.snapshot.versions),
    }


def write(run_folder: Path, summary: Summary) -> None:
    """Write `summary.json` whole or not at all."""
    unfinished = run_folder / f".{FILE_NAME}"
    unfinished.write_text(json.dumps(summary, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    unfinished.replace(run_folder / FILE_NAME)


def table(summary: Summary) -> Table:
    """The summary for a person: figures with units, and what spoils the run in red."""
    from rich.markup import escape
    from rich.table import Table

    shown = Table(title=escape(summary["scene"]), show_header=False, title_justify="left")
    shown.add_column(style="bold")
    shown.add_column()
    outcomes = ", ".join(f"{count} {name}" for name, count in summary["outcomes"].items()) or "none"
    if set(summary["outcomes"]) - {Outcome.CONVERGED.value}:
        outcomes += "  [red]not all converged[/red]"
    above = f"; above the tolerance, or unknown, in {count} steps" if (count := summary["steps_above_tolerance"]) else ""
    slow = f"; numpy solved {count} of the shapes" if (count := summary["solved_by"].get("numpy", 0)) else ""
    whole = summary["complete"] and summary["steps"] > 0
    rows: Iterable[tuple[str, str]] = (
        ("steps", f"{summary['steps']} of {summary['steps_planned']}" + ("" if whole else f"  [red]{escape(summary['sentence'])}[/red]")),
        ("speed", "unknown" if (speed := summary["steps_per_second"]) is None else f"{speed:.0f} steps/s in the loop{slow}"),
        ("wall time", "unknown" if summary["wall_s"] is None else f"{summary['wall_s']:.1f} s with start-up, pictures and replay"),
        ("outcomes", outcomes),
        ("worst penetration", _length(summary["worst_penetration_m"])),
        ("worst grasp error", _length(summary["worst_grasp_error_m"])),
        ("worst error estimate", _length(summary["worst_error_estimate_m"]) + above),
        (
            "worst coupling",
            "unknown" if (most := summary["worst_coupling_m"]) is None else f"{_length(most)}, by one more round; within the estimate",
        ),
        ("contacts", f"{summary['contacts_max']} at most"),
        ("rounds of a step", f"{summary['rounds_max']} at most"),
        ("tension", _figure(summary["tension_max_N"], "N at most")),
        ("grasp force", _figure(summary["grasp_force_max_N"], "N at most")),
        ("bend radius", _length(summary["bend_radius_min_m"], "at least")),
        ("joint torque", _figure(summary["torque_ratio_max"], "of the limit at most")),
        ("robot collisions", f"[red]in {summary['collisions']} steps[/red]" if summary["collisions"] else "none"),
        ("bill of a step", ", ".join(f"{part} {value:.3f}" for part, value in summary["bill_ms"].items()) + " ms (medians)"),
    )
    if count := summary["steps_with_overlapping_cables"]:
        rows = (*rows, ("cables", f"[red]in each other in {count} steps; they touch if both have the same self_interaction[/red]"))
    if count := summary["frames_between_equilibria"]:
        rows = (*rows, ("snaps", f"shown as an artificial motion, in {count} frame{'s' if count > 1 else ''}"))
    rows = (
        *rows,
        *(("effects", f"[red]{escape(text)}[/red]" if is_bad else escape(text)) for text, is_bad in sentences(summary["effects"])),
    )
    for label, text in rows:
        shown.add_row(label, text)
    return shown


class _Tally:
    """Extremes and counts, frame by frame, so that a long run needs little memory."""

    def __init__(self) -> None:
        self._bills: list[tuple[float, ...]] = []
        self._outcomes: Counter[str] = Counter()
        self._most: dict[str, float] = {}
        self._paths: Counter[str] = Counter()
        self._contacts = self._rounds = self._collisions = self._above = self._overlapping = 0
        self.frames = self.between = 0  # frames of equilibria, and between two of them

    def add(self, frame: Frame, scene: Scene) -> None:
        """Count a frame of a scene in."""
        self.frames += 1
        errors = [_with_coupling(frame, index) for index in range(len(frame.shapes))]
        self._above += any(error is None or error > scene.tolerance for error in errors)
        self._note("coupling", max(frame.coupling, default=-np.inf))
        self._overlapping += _overlap(frame, scene)
        if frame.sequence > 0:
            self._bills.append(tuple(getattr(frame.bill, part) for part in BILL))
        self._collisions += bool(frame.collisions)
        self._contacts = max(self._contacts, len(frame.touching.s))
        self._rounds = max(self._rounds, frame.rounds)
        self._note("penetration", frame.penetration)
        self._note("grasp_error", frame.grasp_error)
        self._note("torque_ratio", frame.torque_ratio)
        for shape, error in zip(frame.shapes, errors, strict=True):
            self._outcomes[shape.outcome.value] += 1
            if shape.outcome is Outcome.CONVERGED:
                self._note("error", -np.inf if error is None else error)
                self._add_shape(shape)

    def _add_shape(self, shape: Shape) -> None:
        self._paths[shape.cost.path] += 1
        self._note("tension", float(shape.tension.max(initial=-np.inf)))
        self._note("curvature", float(np.abs(shape.curvature).max(initial=0.0)))
        if len(shape.grasp_wrenches):
            self._note("grasp_force", float(np.linalg.norm(shape.grasp_wrenches[:, :3], axis=1).max()))

    def _note(self, name: str, value: float) -> None:
        self._most[name] = max(value, self._most.get(name, -np.inf))

    def values(self) -> Summary:
        """What the frames so far come to; null for what none of them said."""
        bills = np.array(self._bills).reshape(-1, len(BILL))
        counted = bills[WARM_UP:] if len(bills) > 2 * WARM_UP else bills
        total = float(counted[:, BILL.index("total")].sum())
        most = {name: float(value) if np.isfinite(value) else None for name, value in self._most.items()}
        curvature = most.get("curvature")
        return {
            "steps_per_second": len(counted) / total if total > 0 else None,
            "worst_penetration_m": most.get("penetration"),
            "worst_grasp_error_m": most.get("grasp_error"),
            "worst_error_estimate_m": most.get("error"),
            "worst_coupling_m": most.get("coupling"),
            "steps_above_tolerance": self._above,
            "outcomes": dict(sorted(self._outcomes.items())),
            "solved_by": dict(sorted(self._paths.items())),
            "contacts_max": self._contacts,
            "rounds_max": self._rounds,
            "frames_between_equilibria": self.between,
            "collisions": self._collisions,
            "steps_with_overlapping_cables": self._overlapping,
            "tension_max_N": most.get("tension"),
            "bend_radius_min_m": 1.0 / curvature if curvature else None,
            "grasp_force_max_N": most.get("grasp_force"),
            "torque_ratio_max": most.get("torque_ratio"),
            "bill_ms": {part: 1e3 * float(np.median(bills[:, column])) if len(bills) else 0.0 for column, part in enumerate(BILL)},
        }


def _with_coupling(frame: Frame, index: int) -> float | None:
    """Estimated error [m] of a cable at the end of a step: of its shape, and what one more round would change; None if unknown."""
    error = frame.shapes[index].error
    return error if error is None or not frame.coupling else error + frame.coupling[index]


def _overlap(frame: Frame, scene: Scene) -> bool:
    """Whether two cables are in each other that do not keep off each other."""
    for (one, first), (other, second) in combinations(zip(scene.cables, frame.shapes, strict=True), 2):
        if one.self_interaction is other.self_interaction and one.self_interaction in TOUCHING:
            continue
        touching = 0.5 * (one.diameter + other.diameter)
        if distance(first.nodes, second.nodes, touching) < touching:
            return True
    return False


def _length(value: float | None, note: str = "") -> str:
    if value is None:
        return "unknown"
    if value == 0.0:
        return "none"
    for factor, unit in ((1.0, "m"), (1e3, "mm"), (1e6, "um")):
        if abs(value) * factor >= 1.0:
            return f"{value * factor:.3g} {unit} {note}".strip()
    return f"{value * 1e9:.3g} nm {note}".strip()


def _figure(value: float | None, unit: str) -> str:
    return "unknown" if value is None else f"{value:.3g} {unit}"
