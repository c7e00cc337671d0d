"""Runs the real command line in a place of its own, and sees to it that bad input leaves nothing behind."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from scenarios.children import environment

LIMIT = 180.0  # s; a first run compiles, which takes about 20 s


@dataclass(frozen=True)
class Place:
    """A folder to work in, and one for temporary files that starts and must end empty."""

    work: Path
    temporary: Path

    def write(self, name: str, content: str | bytes) -> Path:
        file = self.work / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return file

    def refused(self, *arguments: str) -> list[str]:
        """The lines on stderr of a command that must be refused: code 2, no traceback, nothing on stdout, nothing left."""
        before = self._files()
        done = subprocess.run(
            [sys.executable, "-c", "from scenarios.cli import main; main()", *arguments],
            cwd=self.work,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            env=environment() | {"TMPDIR": str(self.temporary), "NO_COLOR": "1", "COLUMNS": "200"},
            check=False,
        )
        assert "Traceback" not in done.stderr, done.stderr
        assert '  File "' not in done.stderr, done.stderr
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        assert self._files() == before, "something was left behind or changed"
        assert list(self.temporary.iterdir()) == []
        assert not list(_children(self.temporary))
        return done.stderr.splitlines()

    def _files(self) -> dict[str, bytes]:
        return {str(path): path.read_bytes() if path.is_file() else b"" for path in self.work.rglob("*")}


@contextmanager
def place() -> Iterator[Place]:
    """A place in a folder with a short name, for the paths of ipc sockets are limited to about 100 bytes."""
    box = Path(tempfile.mkdtemp(prefix="bad-"))
    made = Place(box / "work", box / "tmp")
    made.work.mkdir()
    made.temporary.mkdir()
    try:
        yield made
    finally:
        shutil.rmtree(box)


def replaced(text: str, changes: Sequence[tuple[str, str]]) -> str:
    """The text with every change made; each must apply exactly once."""
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the text"
        text = text.replace(old, new)
    return text


def _children(temporary: Path) -> Iterator[int]:
    """Processes whose temporary folder is ours, on Linux."""
    mark = f"TMPDIR={temporary}".encode()
    for entry in Path("/proc").glob("[0-9]*/environ"):
        try:
            if int(entry.parent.name) != os.getpid() and mark in entry.read_bytes().split(b"\0"):
                yield int(entry.parent.name)
        except OSError:
            continue  # it ended meanwhile, or belongs to another user
