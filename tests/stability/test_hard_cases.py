"""Every case of the catalogue ends as it should: right, or declined where that is known; none is wrong but the known ones.

References and tolerances stand with the cases, in `shape_server/hard_cases` and `env_server/hard_cases`.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from _pytest.mark.structures import ParameterSet
from in_process import Direct

from env_server.hard_cases import catalogue as of_environment
from protocol.hard_case import Case, Check, Ending
from scenarios import hard_cases
from scenarios.children import environment
from scenarios.endings import as_json, table
from shape_server import kernels
from shape_server.hard_cases.catalogue import catalogue, warm_up

CASES = catalogue()
PLAYED = of_environment.catalogue()
SECONDS: dict[str, list[float]] = defaultdict(list)
LIMIT = 20  # s for a case; measured 0.3 at most among the fast ones


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    warm_up(kernels)


def params(cases: tuple[Case, ...], every: int = 1) -> list[ParameterSet]:
    """The cases, marked as slow but for every so many of those that are not."""
    return [
        pytest.param(case, id=f"{case.family}-{case.name}", marks=[pytest.mark.slow] * (case.is_slow or number % every > 0))
        for number, case in enumerate(cases)
    ]


@pytest.mark.timeout(LIMIT, func_only=True)
@pytest.mark.parametrize("case", params(CASES))
def test_a_hard_case_ends_as_it_should(case: Case) -> None:
    check(case, kernels)


@pytest.mark.parametrize("case", params(PLAYED, every=8))
def test_a_hard_case_that_is_played_ends_as_it_should(case: Case) -> None:
    check(case, Direct())


def check(case: Case, answering: object) -> None:
    """Run a case, and keep its seconds."""
    begun = time.perf_counter()
    verdict = case.run(answering)
    if not case.is_slow:
        SECONDS[case.family].append(time.perf_counter() - begun)
    if case.known:
        assert verdict.ending is Ending.WRONG, f"no longer wrong; take the mark away ({verdict.sentence})"
    elif not case.may_decline:
        assert verdict.ending is Ending.RIGHT, verdict.sentence
    assert bool(case.known) or verdict.ending is not Ending.WRONG, verdict.sentence
    assert len(verdict.sentence) > 20


def test_no_case_takes_a_hundred_times_as_long_as_its_family() -> None:
    """Runs after all cases; measured 2 to 41 on a machine with other work."""
    for family, seconds in SECONDS.items():
        assert max(seconds) < max(100 * statistics.median(seconds), 1.0), family


def test_the_catalogue_is_large_and_its_names_are_unique() -> None:
    cases = CASES + PLAYED
    assert len(cases) >= 950
    assert len({case.name for case in cases}) == len(cases)
    assert sum(bool(case.known) for case in cases) <= 2


def _measured(error: float, path: ModuleType) -> list[Check]:
    return [Check("a", 0.5, 1.0), Check("b", error, 1.0, told=2.0)]


@pytest.mark.parametrize(
    ("error", "ending"), [(0.9, Ending.RIGHT), (1.5, Ending.OUTSIDE), (3.0, Ending.WRONG), (np.nan, Ending.WRONG), (np.inf, Ending.WRONG)]
)
def test_an_error_above_the_tolerance_is_wrong_unless_the_answer_owns_up_to_it(error: float, ending: Ending) -> None:
    assert Case("x", "y", partial(_measured, error)).run(kernels).ending is ending


def test_what_a_solver_raises_is_wrong_and_a_warning_too() -> None:
    def divides(path: ModuleType) -> list[Check]:
        return [Check("a", float(np.array(1.0) / np.array(0.0)), 1.0)]

    for measure in (divides, lambda path: [], lambda path: [][0]):
        assert Case("x", "y", measure).run(kernels).ending is Ending.WRONG


@pytest.mark.thorough
def test_a_case_that_hangs_is_ended_and_counts_as_wrong() -> None:
    """With a limit of a hundredth of the time that it takes."""
    long = [case for case in hard_cases.listed() if "a thousand steps" in case.name and case.program == "shape_server"]
    ended = list(hard_cases.run(long[:1], "compiled", 0.01))
    assert [result.verdict.ending for result in ended] == [Ending.WRONG]
    assert "no answer within 0.01 s" in ended[0].verdict.sentence
    assert "WRONG moving" in table(ended)


@pytest.mark.thorough
def test_a_case_that_is_no_longer_wrong_is_told() -> None:
    case = replace(hard_cases.listed()[0], known="it was wrong once")
    result = hard_cases.Result(case, CASES[0].run(kernels), 0.1)
    assert result.is_silent
    assert "known to be wrong, and right now" in table([result])
    assert json.loads(as_json([result]))[0]["known"] == "it was wrong once"


@pytest.mark.thorough
def test_a_program_answers_for_a_case_of_its_own_room_and_so_does_the_environment_with_a_shape_server() -> None:
    names = ("dragged over a floor, signum, mu 0.3", "random, forces of 0 N")
    asked = [case for case in hard_cases.listed() if case.name in names]
    ended = list(hard_cases.run(asked, "compiled"))
    assert [result.case.program for result in ended] == ["shape_server", "env_server"]
    assert [result.verdict.ending for result in ended] == [Ending.RIGHT] * 2


def hardcases(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from scenarios.cli import main; main()", "hardcases", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, env=environment(), check=False)


@pytest.mark.thorough
def test_the_command_prints_a_table_and_writes_every_case(tmp_path: Path) -> None:
    run = hardcases("--family", "absurd starts", "--json", "cases.json", folder=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    head, row = run.stdout.splitlines()[:2]
    assert head.split()[:6] == ["family", "cases", "right", "refused", "outside", "wrong"]
    assert row.startswith("absurd starts")
    assert "absurd starts" in run.stderr
    written = json.loads((tmp_path / "cases.json").read_text(encoding="utf-8"))
    assert [row["name"] for row in written] == [case.name for case in catalogue("absurd starts")]
    assert {row["ending"] for row in written} <= {"right", "refused"}
    assert all(row["sentence"] and row["seconds"] > 0 for row in written)


@pytest.mark.thorough
def test_the_command_names_its_cases_and_refuses_an_unknown_family(tmp_path: Path) -> None:
    listed = hardcases("--list", folder=tmp_path)
    assert listed.stdout.count("\n") == len(CASES) + len(PLAYED)
    wrong = hardcases("--family", "contcats", folder=tmp_path)
    assert wrong.returncode == 2
    assert "family 'contcats' unknown; there are 'taut and slack'" in wrong.stderr
