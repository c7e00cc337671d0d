"""The paper's figures as one page that opens offline: claim, our picture, what was measured, and what differs and why."""

from __future__ import annotations

import base64
import html
import json
import re
from pathlib import Path
from typing import Any, Final

from protocol.errors import CablecosimError

from .page_style import STYLE
from .planar import draw

INTRODUCTION: Final = (
    "Every figure of &ldquo;Simulating robotic manipulation of cabling and interaction with surroundings&rdquo; that shows a quasi-static "
    "cable, as a scene that ran through the three programs: what the paper says, our picture in the figure's own view, what was measured "
    "from the recording, and what differs. The paper gives most of its numbers only as pictures; there ours are chosen to "
    "show the same thing, and the text says so. Gravity, along &minus;y in the paper, is along &minus;z here."
)


def write(report: Path, page: Path) -> None:
    """Write the page of a report that `cablecosim paper` made.

    Raises:
        CablecosimError: If the report is none.
    """
    try:
        content = json.loads(report.read_text(encoding="utf-8"))
        figures = content["figures"]
        contents = _contents(figures, content["seconds"])
        sections = "\n".join(_section(figure, report.parent) for figure in figures)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CablecosimError(f"{report}: is no report of `cablecosim paper`: {error!r}", key=str(report)) from error
    title = "The paper, reproduced"
    page.write_text(
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>"
        f'<p class="lead">{INTRODUCTION}</p>{contents}\n{sections}\n</body></html>\n',
        encoding="utf-8",
    )


def _contents(figures: list[dict[str, Any]], seconds: float) -> str:
    rows = "".join(
        f'<tr><td><a href="#{figure["module"]}">{html.escape(figure["name"])}</a></td><td>{html.escape(figure["title"])}</td>'
        f'<td class="{"ok" if figure["holds"] else "not"}">{_held(figure)} as said</td></tr>'
        for figure in figures
    )
    return f'<nav><table>{rows}</table></nav><p class="how">All of it ran in {seconds:.0f} s.</p>'


def _section(figure: dict[str, Any], folder: Path) -> str:
    panels = "".join(_panel(panel, number, figure["module"]) for number, panel in enumerate(figure["panels"]))
    pictures = "".join(_picture(one, folder) for one in figure["screenshots"])
    count = sum(not panel["is_wide"] for panel in figure["panels"]) + len(figure["screenshots"])
    columns = "panels" if count > 4 or count == 3 else "panels two"
    steps = "".join(f"<li>{_text(step)}</li>" for step in figure["procedure"])
    differs = f'<p class="differs"><b>what differs, and why</b>{_text(figure["differs"])}</p>' if figure["differs"] else ""
    return (
        f'<section id="{figure["module"]}"><h2>{html.escape(figure["name"])} &middot; {html.escape(figure["title"])}</h2>'
        f'<p class="claim"><b>the paper says</b>{_text(figure["claim"])}</p><div class="{columns}">{panels}{pictures}</div>'
        f"{_table(figure['phenomena'])}{differs}{f'<ol>{steps}</ol>' if steps else ''}{_how(figure)}</section>"
    )


def _panel(panel: dict[str, Any], number: int, module: str) -> str:
    look = ' class="wide"' if panel["is_wide"] else ""
    # Names within an SVG hold for the whole page, so each gets its own.
    drawn = re.sub(r'(id="|href="#|url\(#)', rf"\1{module}-{number}-", draw(panel))
    return f"<figure{look}>{drawn}<figcaption>{_text(panel['caption'])}</figcaption></figure>"


def _picture(one: dict[str, Any], folder: Path) -> str:
    data = base64.b64encode((folder / one["file"]).read_bytes()).decode("ascii")
    caption = _text(one["caption"])
    return f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>'


def _table(phenomena: list[dict[str, Any]]) -> str:
    rows = "".join(
        f"<tr><td>{_text(one['name'])}</td><td>{_text(one['paper'])}</td><td>{_text(one['measured'])}</td>"
        f'<td class="{"ok" if one["holds"] else "not"}">{"&#10003; as said" if one["holds"] else "&#10007; not so"}</td></tr>'
        for one in phenomena
    )
    return f"<table><tr><th>looked at</th><th>the paper</th><th>measured</th><th></th></tr>{rows}</table>"


def _how(figure: dict[str, Any]) -> str:
    commands = []
    for take in figure["takes"]:
        words = " ".join(f"--set {setting}" for setting in take["settings"])
        commands.append(f"<code>cablecosim run {html.escape(take['scene'])}{' ' if words else ''}{html.escape(words)}</code>")
    return f'<p class="how">Run it alone: {", ".join(commands)}. It took {figure["seconds"]:.1f} s.</p>'


def _held(figure: dict[str, Any]) -> str:
    return f"{sum(one['holds'] for one in figure['phenomena'])} of {len(figure['phenomena'])}"


def _text(text: str) -> str:
    """Text with what stands between backticks as code, and what is within [text](address) as a link."""
    shown = re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
    return re.sub(r"\[([^\]]+)\]\((https?://[^)]+)\)", r'<a href="\2">\1</a>', shown)
