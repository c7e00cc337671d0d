"""A calibration as a table for people and as JSON for programs."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from .fit import Calibration
from .interval import CONFIDENCE, Interval
from .parameters import PARAMETERS


def table(found: Calibration) -> str:
    """What was fitted and how well, what was not and why, and how far the points are from the best fit."""
    rows = [("number", "value", f"{CONFIDENCE:.0%} interval", "unit")]
    rows += [(name, f"{one.value:.4g}", _between(one), PARAMETERS[name].unit) for name, one in found.intervals.items()]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [f"{name} not fitted: {reason}" for name, reason in found.left.items()]
    rms, most = float(np.sqrt((found.deviations**2).mean())), float(found.deviations.max())
    length = float(found.shape.s[-1])
    lines.append(
        f"{len(found.deviations)} points are {1e3 * rms:.3g} mm from the fit (rms), at most {1e3 * most:.3g} mm or {most / length:.2%} of "
        f"the length; error of measurement {1e3 * found.sigma:.3g} mm in a coordinate, if the model is right"
    )
    return "\n".join(lines)


def as_json(found: Calibration, points: Path) -> str:
    """All of it, SI units; a bound that the points do not set is null."""
    numbers = {name: _plain(one) | {"unit": PARAMETERS[name].unit} for name, one in found.intervals.items()}
    report = {
        "points": str(points),
        "confidence": CONFIDENCE,
        "numbers": numbers,
        "not_fitted": found.left,
        "sigma": found.sigma,
        "deviations": found.deviations.tolist(),
        "s": found.shape.s.tolist(),
        "nodes": found.shape.nodes.tolist(),
    }
    return json.dumps(report, indent=1) + "\n"


def _between(one: Interval) -> str:
    low = f"{one.low:.4g}" if one.low > 0.0 else "no lower bound"
    high = f"{one.high:.4g}" if math.isfinite(one.high) else "no upper bound"
    return f"{low} to {high}"


def _plain(one: Interval) -> dict[str, float | str | None]:
    return {"value": one.value, "low": one.low or None, "high": one.high if math.isfinite(one.high) else None}
