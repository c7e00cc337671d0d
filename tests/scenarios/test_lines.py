"""Line numbers of keys in TOML, also where the text is written in an unusual way."""

from __future__ import annotations

import tomllib
from typing import Any

from scenarios.lines import Path, lines_of, nearest_line, written

TEXT = '''\
a.b = 1
"c d" = 'x = 1 # no comment'
e = """
not = "a key"
\\""" still a string"""
[f.g]
h = [ 1, # one
  [2,
   3]]
i = {j = 1, k = {l = [
  {m = 2}]}}
[[n]]
o = 1
[n.p]
q = 1979-05-27T07:32:00Z
[[n]]
[[n.r]]
s = \'\'\'
x\'\'\'\'
[[n.r]]
t = true
'''


def paths(value: Any, path: Path = ()) -> list[Path]:
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, part in parts for found in [(*path, key), *paths(part, (*path, key))]]


def test_every_key_has_its_line() -> None:
    lines = lines_of(TEXT)

    expected = {"a.b": 1, "c d": 2, "e": 3, "f.g.h": 7, "f.g.h[1]": 8, "f.g.h[1][1]": 9, "f.g.i.k.l[0].m": 11, "n[0].o": 13}
    expected |= {"n[0].p.q": 15, "n[1]": 16, "n[1].r[0].s": 18, "n[1].r[1]": 20, "n[1].r[1].t": 21}
    found = {written(path): line for path, line in lines.items()}
    assert {key: found[key] for key in expected} == expected


def test_every_path_that_tomllib_reads_is_near_a_line() -> None:
    lines = lines_of(TEXT)

    assert [path for path in paths(tomllib.loads(TEXT)) if path not in lines and path != ("f",)] == []


def test_a_missing_key_is_placed_at_its_table() -> None:
    assert nearest_line(lines_of(TEXT), ("n", 1, "r", 1, "absent")) == 20
    assert nearest_line(lines_of(TEXT), ("absent",)) is None
