"""Which effects were simulated when, why, and what those left out could have changed: from a recording alone.

For every cable and effect that there was a choice about, the steps of a run are cut into stretches in which it was on or off for the same
reason. Of each stretch stand here the first and last time, the largest predicted size, and the largest share of the tolerance.
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

    def add(self, frame: Frame) -> None:
        """Count a frame in."""
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
            {"cable": cable, "effect": effect, "tolerance_m": self._tolerance, "stretches": stretches}
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
        yield told + (f", above the tolerance of {one['tolerance_m']:.2g} m, as asked" if is_bad else ""), is_bad
