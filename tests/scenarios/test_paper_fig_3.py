"""Fig. 3 from end to end: the command, the three programs, the report and the page."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from scenarios.children import environment


@pytest.mark.thorough
def test_fig_3_is_two_cables_of_one_equation_on_a_page_that_opens_offline(tmp_path: Path) -> None:
    words = [sys.executable, "-c", "from scenarios.cli import main; main()", "paper", "3", "--out", "mine"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=200, env=environment(), check=False)

    assert done.returncode == 0, done.stdout + done.stderr
    assert "Fig. 3  Held at two ends, and at intermediate points: 2 of 2 as the paper says" in done.stdout
    (figure,) = json.loads((tmp_path / "mine" / "paper.json").read_text())["figures"]
    assert figure["holds"] is True
    assert len(figure["panels"][0]["curves"]) == 2
    assert "<svg" in (tmp_path / "mine" / "paper.html").read_text()
    assert (tmp_path / "mine" / "takes" / "fig_3_held-held" / "recording.msgpack").is_file()
