"""Studies and audits as tables for people and as JSON for programs and for the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from .audit import BUDGET_KEPT, COVERAGE, PESSIMISM, TOLERANCE_KEPT, Audited, Summary
from .frontier import frontier, price_of_ten, sentence
from .study import AUTOMATIC, Row, Studied


def study_table(studies: Sequence[Studied]) -> str:
    """One row a problem: time and true error for three tolerances, and what ten times the accuracy costs."""
    rows = [("problem", "asked", "error", "ms", "asked", "error", "ms", "asked", "error", "ms", "x10 costs")]
    for one in studies:
        automatic = [row for row in one.rows if row.group == AUTOMATIC]
        cells = [one.name]
        for row in _three(automatic):
            cells += ["-"] * 3 if row is None else [row.setting, f"{row.error:.0e}", f"{1e3 * row.seconds:.2f}"]
        price = price_of_ten(automatic)
        rows.append((*cells, f"{price:.2f}" if price else "-"))  # type: ignore[arg-type]
    return _aligned(rows) + "\nerrors over the length, true; CPU time of a cold answer, of a whole loop of motions, or of a whole run"


def _three(rows: Sequence[Row]) -> list[Row | None]:
    """Those for three tolerances over the length; of others the coarsest, the middle one and the finest."""
    asked = [next((row for row in rows if row.setting == wanted), None) for wanted in ("0.001 L", "1e-05 L", "1e-07 L")]
    if any(asked) or not rows:
        return asked
    return [rows[0], rows[len(rows) // 2], rows[-1]]


def study_json(studies: Sequence[Studied]) -> dict[str, Any]:
    """All rows, with the frontier and the sentence of each problem."""
    return {
        "problems": [
            {
                "name": one.name,
                "title": one.title,
                "sentence": sentence(one),
                "measured": one.measured,
                "rows": [_plain(row) for row in one.rows],
                "frontier": [[row.error, row.seconds] for row in frontier(one.rows)],
                "refused": dict(one.refused),
            }
            for one in studies
        ]
    }


def from_elsewhere(problem: dict[str, Any]) -> Studied:
    """A study whose rows were measured elsewhere, from plain values as `study_json` gives them."""
    rows = [Row(**(row | {"estimate": math.inf if row["estimate"] is None else row["estimate"]})) for row in problem["rows"]]
    return Studied(problem["name"], problem["title"], tuple(rows), (), (), tuple(problem["remarks"]), problem["measured"])


def audit_table(summaries: Sequence[Summary]) -> str:
    """One row a kind of request, and what is wanted."""
    rows = [
        ("requests", "cases", "unknown", "coverage", "pessimism", "tolerance kept", "budget kept", "answered", "its coverage", "median ms")
    ]
    rows += [
        (
            one.kind,
            str(one.cases),
            str(one.unknown),
            f"{one.coverage:.1%}",
            f"{one.pessimism:.2f}",
            f"{one.tolerance_kept:.1%}",
            f"{one.budget_kept:.1%}",
            f"{one.answered:.1%}",
            f"{one.answered_coverage:.1%}",
            f"{one.milliseconds:.2f}",
        )
        for one in summaries
    ]
    rows.append(
        (
            "wanted",
            "",
            "",
            f">= {COVERAGE:.0%}",
            f"<= {PESSIMISM:g}",
            f">= {TOLERANCE_KEPT:.0%}",
            f">= {BUDGET_KEPT:.0%}",
            "",
            f">= {COVERAGE:.0%}",
            "",
        )
    )
    return _aligned(rows)


def audit_json(results: Sequence[Audited], summaries: Sequence[Summary]) -> dict[str, Any]:
    """Every request and the summaries."""
    return {"summaries": [asdict(one) for one in summaries], "requests": [asdict(one) for one in results]}


def _plain(row: Row) -> dict[str, Any]:
    """A row whose estimate is null where the program gives none."""
    return asdict(row) | {"estimate": row.estimate if math.isfinite(row.estimate) else None}


def _aligned(rows: Sequence[tuple[str, ...]]) -> str:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]) for row in rows
    ]
    return "\n".join(lines)
