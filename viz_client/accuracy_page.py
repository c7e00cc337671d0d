"""What accuracy costs in time as one page that opens offline: a plot and a sentence for each problem, then the numbers."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from protocol.errors import CablecosimError

from .chart import Series, error_against_time

FLOOR: Final = 1e-12  # over the length; what is below is drawn there
STYLE: Final = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}"
    "h1{font-size:1.7rem}h2{font-size:1.2rem;margin-top:2.5rem}svg{width:100%;height:auto}"
    "table{border-collapse:collapse;font-size:.85rem}td,th{padding:.15rem .6rem;text-align:right;border-bottom:1px solid #eee}"
    "td:first-child,td:nth-child(2),th:first-child,th:nth-child(2){text-align:left}summary{cursor:pointer;color:#555}"
)
INTRODUCTION: Final = (
    "Every point is one way to ask for the shape of a cable: what it cost, and how far its nodes really are from a reference of other "
    "making (collocation by SciPy, closed forms). The grey line joins the settings that no other one beats in both. "
    "&ldquo;Tolerance, automatic&rdquo; is what a user gets who only says how exact the shape is to be."
)


def write(report: Path, page: Path) -> None:
    """Write the page of a report that `cablecosim accuracy` made.

    Raises:
        CablecosimError: If the report is none.
    """
    try:
        problems = json.loads(report.read_text(encoding="utf-8"))["problems"]
        sections = "\n".join(_section(problem) for problem in problems)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CablecosimError(f"{report}: is no report of `cablecosim accuracy`: {error!r}", key=str(report)) from error
    title = "What accuracy costs in time"
    page.write_text(
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style></head>'
        f"<body><h1>{title}</h1><p>{INTRODUCTION}</p>\n{sections}\n</body></html>\n",
        encoding="utf-8",
    )


def _section(problem: dict[str, Any]) -> str:
    rows = problem["rows"]
    groups = list(dict.fromkeys(row["group"] for row in rows))
    series = [_series(group, [row for row in rows if row["group"] == group]) for group in groups]
    error, seconds = zip(*problem["frontier"], strict=True)
    chart = error_against_time(series, ([1e3 * value for value in seconds], [max(value, FLOOR) for value in error]), problem["measured"])
    refused = "".join(f"<li>{html.escape(name)}: {html.escape(why)}</li>" for name, why in problem["refused"].items())
    return (
        f"<h2>{html.escape(problem['title'])}</h2>{chart}<p>{html.escape(problem['sentence'])}</p>"
        f"<details><summary>the numbers</summary>{_table(rows)}{f'<p>Without a shape:</p><ul>{refused}</ul>' if refused else ''}</details>"
    )


def _series(group: str, rows: Sequence[dict[str, Any]]) -> Series:
    is_named = group in ("model", "effect left out")
    return Series(
        group,
        [1e3 * row["seconds"] for row in rows],
        [max(row["error"], FLOOR) for row in rows],
        [row["setting"] for row in rows] if is_named else [],
    )


def _table(rows: Sequence[dict[str, Any]]) -> str:
    head = "".join(
        f"<th>{name}</th>" for name in ("how", "setting", "true error / L", "estimate / L", "CPU ms", "nodes", "factorisations", "model")
    )
    lines = "".join(
        f"<tr><td>{html.escape(row['group'])}</td><td>{html.escape(row['setting'])}</td><td>{row['error']:.1e}</td>"
        f"<td>{_number(row['estimate'])}</td><td>{1e3 * row['seconds']:.2f}</td><td>{row['nodes']}</td><td>{row['factorisations']}</td>"
        f"<td>{html.escape(row['model'])}</td></tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{lines}</table>"


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.1e}"
