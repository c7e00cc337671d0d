"""How the pages that open offline look, as the text of a style sheet."""

from __future__ import annotations

from typing import Final

STYLE: Final = (
    ":root{--ink:#1d2329;--soft:#5b6670;--line:#e2e6ea;--good:#0b6e4f;--bad:#b3261e;--tint:#f5f7f9}"
    "body{font:16px/1.55 system-ui,sans-serif;max-width:74rem;margin:0 auto;padding:2rem 1.5rem 5rem;color:var(--ink)}"
    "h1{font-size:2rem;line-height:1.2;margin:0 0 .5rem}h2{font-size:1.3rem;margin:0 0 .8rem}a{color:#00566b}"
    ".lead{max-width:50rem;color:var(--soft)}section{margin-top:3rem;padding-top:1.6rem;border-top:2px solid var(--line)}"
    ".claim{background:var(--tint);border-left:4px solid #00798c;padding:.7rem 1rem;margin:0 0 1.2rem;max-width:62rem}"
    ".claim b,.differs b{display:block;font-size:.75rem;letter-spacing:.06em;text-transform:uppercase;color:var(--soft)}"
    ".panels{display:grid;grid-template-columns:repeat(3,1fr);gap:1.2rem 1.6rem;align-items:start}"
    ".panels.two{grid-template-columns:1fr 1fr}"
    "@media(max-width:50rem){.panels,.panels.two{grid-template-columns:1fr}}"
    "figure{margin:0}figure.wide{grid-column:1/-1}figure svg,figure img{width:100%;height:auto;display:block}"
    "figcaption{font-size:.9rem;color:var(--soft);padding:.2rem .4rem 0}"
    "table{border-collapse:collapse;font-size:.92rem;width:100%;margin:1.2rem 0}"
    "th{text-align:left;font-weight:600;color:var(--soft);font-size:.8rem}td,th{padding:.35rem .7rem .35rem 0;vertical-align:top;"
    "border-bottom:1px solid var(--line)}td.ok{color:var(--good);white-space:nowrap;font-weight:600}"
    "td.not{color:var(--bad);white-space:nowrap;font-weight:600}"
    ".differs{max-width:62rem}code{font-size:.86em;background:var(--tint);padding:.1em .3em;border-radius:3px}"
    ".how{font-size:.85rem;color:var(--soft)}nav table{max-width:50rem}ol li{margin:.3rem 0;max-width:60rem}"
    "@media print{section{break-inside:avoid}}"
    "span.ok{color:var(--good);font-weight:600}span.not{color:var(--bad);font-weight:600}"
)
