"""Which effects were simulated when, why, and what those left out could have changed: from a recording alone.

For every cable and effect that there was a choice about, the steps of a run are cut into stretches in which it was on or off for the same
reason. Of each stretch stand here the first and last time, and the largest predicted sizes; beside them audits, predicted against actual.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from protocol.messages import Frame
from protocol.scene import Scene

Stretch = dict[str, Any]


class Timeline:
    """Stretches of one run, frame by frame."""

    def __init__(self, scene: Scene) -> None:
        self._names = [cable.name for cable in scene.cables]
        self._tolerance = scene.tolerance
        self._stretches: dict[tuple[str, str], list[Stretch]] = {}
        self._audits: dict[tuple[str, str], list[dict[str, Any]]] = {}
        self._times: list[float] = []

    def add(self, frame: Frame) -> None:
        """Count a frame in."""
        self._times.append(frame.time)
        for audit in frame.audits:
            told = {
                "step": audit.step,
                "time_s": self._times[audit.step],
                "predicted_m": audit.bound,
                "actual_m": audit.actual,
                "broken": audit.is_broken,
                "switched_on_from_s": frame.time if audit.is_switched_on else None,
            }
            self._audits.setdefault((self._names[audit.cable], audit.name), []).append(told)
        for cable, shape in zip(self._names, frame.shapes, strict=True):
            for one in shape.predicted:
                known = self._stretches.setdefault((cable, one.name), [])
                if not known or (known[-1]["on"], known[-1]["why"]) != (one.is_on, one.why):
                    known.append(
                        {"from_s": frame.time, "on": one.is_on, "why": one.why, "size_m": 0.0, "force_N": 0.0, "curvature_1_m": 0.0}
                    )
                last = known[-1]
                last["to_s"] = frame.time
                for key, value in (("size_m", one.size), ("force_N", one.force), ("curvature_1_m", one.curvature)):
                    last[key] = max(last[key], value)

    def values(self) -> list[dict[str, Any]]:
        """One entry for each cable and effect: its stretches, in order."""
        return [
            {
                "cable": cable,
                "effect": effect,
                "tolerance_m": self._tolerance,
                "stretches": stretches,
                "audits": self._audits.get((cable, effect), []),
            }
            for (cable, effect), stretches in self._stretches.items()
        ]


def sentences(effects: list[dict[str, Any]]) -> Iterator[tuple[str, bool]]:
    """What a person should know of the choice, and whether it spoils the run."""
    for one in effects:
        off = [stretch for stretch in one["stretches"] if not stretch["on"]]
        if not off:
            continue
        most = max(stretch["size_m"] for stretch in off)
        times = ", ".join(f"{stretch['from_s']:.3g} to {stretch['to_s']:.3g} s" for stretch in off[:3]) + (", ..." if len(off) > 3 else "")
        is_bad = any(stretch["why"] == "asked" and stretch["size_m"] > one["tolerance_m"] for stretch in off)
        told = f"'{one['effect']}' of '{one['cable']}' left out from {times}: at most {most:.2g} m"
        yield told + (f", above the tolerance of {one['tolerance_m']:.2g} m, as asked" if is_bad else "") + _audited(one["audits"]), is_bad
        for audit in one["audits"]:
            if audit["broken"]:
                yield _broken(one, audit), True


def _audited(audits: list[dict[str, Any]]) -> str:
    """What audits found, in short; empty without one."""
    found = [audit for audit in audits if audit["actual_m"] is not None]
    if not audits:
        return ""
    most = f", at most {max(audit['actual_m'] for audit in found):.2g} m" if found else ""
    lost = f", {len(audits) - len(found)} without a shape to compare with" if len(found) < len(audits) else ""
    return f"; audited in {len(audits)} step{'s' if len(audits) > 1 else ''}{most}{lost}"


def _broken(one: dict[str, Any], audit: dict[str, Any]) -> str:
    """That a prediction was false, and what was done about it."""
    since = audit["switched_on_from_s"]
    done = "left out all the same, as asked" if since is None else f"on from {since:.3g} s on"
    told = f"'{one['effect']}' of '{one['cable']}' moved the cable by {audit['actual_m']:.2g} m at {audit['time_s']:.3g} s"
    return f"{told}, where at most {audit['predicted_m']:.2g} m was predicted; {done}"
