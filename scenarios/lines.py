"""Line numbers of the keys in a TOML text, which tomllib does not give.

A key's path is the way to its value in the parsed data: names for tables, numbers for places in lists. The scanner
trusts its text: whatever is no TOML has been refused by tomllib before.
"""

from __future__ import annotations

import tomllib
from typing import Final

Path = tuple[str | int, ...]

_SPACE: Final = " \t\r\n"
_BARE_END: Final = ",]}#\n\r"


def lines_of(text: str) -> dict[Path, int]:
    """The line, counted from 1, on which each key, table and list element of a valid TOML text begins."""
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


def nearest_line(lines: dict[Path, int], path: Path) -> int | None:
    """Line of a path, or of the nearest table that would hold it; None if even its first key is not there."""
    for size in range(len(path), 0, -1):
        if path[:size] in lines:
            return lines[path[:size]]
    return None


def written(path: Path) -> str:
    """A path as people write it: cables[0].bending."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def key_path(key: str) -> Path:
    """The path that a written key such as cables[0].bending stands for."""
    parts = key.replace("[", ".").replace("]", "").split(".")
    return tuple(int(part) if part.isdecimal() else part for part in parts if part)


class _Scanner:
    """Walks once through the text; `at` is the offset of the next character."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Path, int] = {}
        self._last: dict[Path, int] = {}  # path of every array of tables -> index of its newest table

    def document(self) -> None:
        table: Path = ()
        while self._skip():
            if self._next("[["):
                table = self._open(self._key())
                self.at += 2
            elif self._next("["):
                table = self._within(self._key())
                self._note(table)
                self.at += 1
            else:
                self._pair(table)

    def _pair(self, table: Path) -> None:
        start = self.at
        path = table + self._key()
        self._skip()
        self.at += 1  # the equals sign
        for size in range(len(table) + 1, len(path) + 1):
            self.lines.setdefault(path[:size], self._line(start))
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip()
        if self.text[self.at] in "\"'":
            self._string()
        elif self._next("["):
            index = 0
            while self._skip(",") and not self._next("]"):
                self._note((*path, index))
                self._value((*path, index))
                index += 1
        elif self._next("{"):
            while self._skip(",") and not self._next("}"):
                self._pair(path)
        else:
            while self.at < len(self.text) and self.text[self.at] not in _BARE_END:
                self.at += 1

    def _string(self) -> str:
        """Step over a string of any of the four kinds, and return it as written."""
        start, quote = self.at, self.text[self.at]
        end = quote * 3 if self.text.startswith(quote * 3, start) else quote
        self.at += len(end)
        while not self.text.startswith(end, self.at):
            self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
        self.at += len(end)
        while len(end) == 3 and self.at < len(self.text) and self.text[self.at] == quote:
            self.at += 1  # TOML allows one or two quotes just before the closing three
        return self.text[start : self.at]

    def _key(self) -> Path:
        """A key such as a.b."c d"; stops at what follows it."""
        parts: list[str] = []
        while True:
            self._skip()
            if self.text[self.at] in "\"'":
                parts.append(str(tomllib.loads(f"x = {self._string()}")["x"]))
            else:
                start = self.at
                while self.text[self.at] not in " \t.=]":
                    self.at += 1
                parts.append(self.text[start : self.at])
            self._skip()
            if not self._next("."):
                return tuple(parts)

    def _open(self, key: Path) -> Path:
        """Begin the next table of an array of tables."""
        path = self._within(key[:-1]) + key[-1:]
        self._last[path] = self._last.get(path, -1) + 1
        self._note(path)
        self._note((*path, self._last[path]))
        return (*path, self._last[path])

    def _within(self, key: Path) -> Path:
        """A key of a table header, with the index of the newest table wherever it passes an array of tables."""
        path: Path = ()
        for part in key:
            path = (*path, part)
            if path in self._last:
                path = (*path, self._last[path])
        return path

    def _note(self, path: Path) -> None:
        self.lines.setdefault(path, self._line(self.at))

    def _line(self, offset: int) -> int:
        return self.text.count("\n", 0, offset) + 1

    def _next(self, expected: str) -> bool:
        """Whether `expected` comes next; if so, it is stepped over."""
        if not self.text.startswith(expected, self.at):
            return False
        self.at += len(expected)
        return True

    def _skip(self, also: str = "") -> bool:
        """Step over blanks, newlines and comments; whether any text is left."""
        while self.at < len(self.text):
            if self.text[self.at] == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            elif self.text[self.at] in _SPACE + also:
                self.at += 1
            else:
                return True
        return False
