"""The paper's figures as `cablecosim paper` knows them; that each shows what it should stands in `test_paper_fig_*.py`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from protocol.errors import CablecosimError
from scenarios.load import built_in, load
from scenarios.paper import MODULES
from scenarios.paper.figure import Figure, Panel, Phenomenon, Result, Take, curve
from scenarios.paper.reproduce import Reproduced, figures, write
from viz_client import paper_page

FIGURES = figures(())


def test_every_figure_has_takes_of_scenes_that_exist_and_no_scene_is_without_a_figure() -> None:
    used = {take.scene for figure in FIGURES.values() for take in figure.takes}
    assert {scene for scene in built_in() if scene.startswith("paper/")} <= used <= set(built_in())
    for figure in FIGURES.values():
        assert len({take.name for take in figure.takes}) == len(figure.takes) > 0
        for take in figure.takes:
            load(take.scene, take.settings)


def test_figures_are_asked_for_by_number_and_come_in_the_order_of_the_paper() -> None:
    names = [name for own in MODULES.values() for name in own]
    assert len(names) == len(set(names))
    last, first = names[-1], names[0]
    assert list(figures((last, first))) == [module for module, own in MODULES.items() if last in own or first in own]
    with pytest.raises(CablecosimError, match="figure '99' unknown; there are 3"):
        figures(("99",))


def test_the_page_shows_claim_measurement_and_verdict_and_fetches_nothing(tmp_path: Path) -> None:
    import numpy as np

    nodes = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, -0.2], [1.0, 0.0, 0.0]])
    phenomena = (Phenomenon("a < b", "it hangs", "0.2 m", holds=True), Phenomenon("pull", "none", "1 N", holds=False))
    figure = Figure("Fig. 0", "A chain", "It hangs & rests.", (Take("one", "paper/none"),), lambda _: Result((), ""))
    panel = Panel("Lower than `0`.", (curve(nodes, label="chain"),))
    report = tmp_path / "paper.json"
    write(report, [Reproduced("fig_0", figure, Result(phenomena, "Nothing.", (panel, panel)), 1.0)], wall=2.0)
    paper_page.write(report, tmp_path / "paper.html")

    assert json.loads(report.read_text())["figures"][0]["holds"] is False
    page = (tmp_path / "paper.html").read_text()
    for words in ("a &lt; b", "It hangs &amp; rests.", "1 of 2 as said", "not so", "Lower than <code>0</code>.", "Nothing."):
        assert words in page
    assert page.count("<svg") == 2
    assert not [word for word in ('src="http', "@import", "<script", 'href="http') if word in page.replace('href="http://www.w3.org', "")]


def test_a_file_that_is_no_report_is_refused(tmp_path: Path) -> None:
    (tmp_path / "paper.json").write_text("{}")
    with pytest.raises(CablecosimError, match="is no report of `cablecosim paper`"):
        paper_page.write(tmp_path / "paper.json", tmp_path / "paper.html")
