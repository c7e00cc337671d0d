"""What other programs make of the hard cases, beside ours: a row a family, and a row for every case that one of them was given."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from protocol.hard_case import Ending

from .endings import aligned
from .hard_cases import PATIENCE, Listed, Result

Answers = Mapping[str, Mapping[Listed, Result]]  # by peer


def table(results: Sequence[Result], peers: Mapping[str, Sequence[Result]]) -> str:
    """Empty if no peer was asked."""
    if not peers:
        return ""
    answers: Answers = {name: {one.case: one for one in given if one.verdict.ending is not Ending.OUTSIDE} for name, given in peers.items()}
    asked = [one for one in results if any(one.case in given for given in answers.values())]
    families = list(dict.fromkeys(one.case.family for one in asked))
    counts = [("family", "ours", *peers), *(_counts(name, [one for one in asked if one.case.family == name], answers) for name in families)]
    cases = [("case", "ours", *peers), *((f"{one.case.family}: {one.case.name}", *_outcomes(one, answers)) for one in asked)]
    return "\n".join(
        [
            "",
            "Other programs on the cases that can be handed on to them: right / no shape / off, of those each was given",
            *aligned([*counts, _counts("all", asked, answers)]),
            "",
            "Each of these cases: errors are over the tolerance, which for other programs is a hundredth of the length; "
            "off counts where they end in another equilibrium, too",
            *aligned(cases),
            "",
        ]
    )


def _counts(name: str, results: Sequence[Result], answers: Answers) -> tuple[str, ...]:
    theirs = ([given[one.case] for one in results if one.case in given] for given in answers.values())
    return (name, *(_count(some) for some in (results, *theirs)))


def _count(results: Sequence[Result]) -> str:
    """Such as 12/3/1; what is outside counts as without a shape."""
    right, off = (sum(one.verdict.ending is ending for one in results) for ending in (Ending.RIGHT, Ending.WRONG))
    return f"{right}/{len(results) - right - off}/{off}" if results else "-"


def _outcomes(result: Result, answers: Answers) -> tuple[str, ...]:
    return (_outcome(result), *(_outcome(given[result.case]) if result.case in given else "-" for given in answers.values()))


def _outcome(result: Result) -> str:
    """Such as "right 0.03", "off 12", "no shape", "not a number", "died with exit code -11", "no answer in 20 s"."""
    verdict = result.verdict
    if verdict.ending is Ending.RIGHT:
        return f"right {verdict.error:.1g}"
    if verdict.ending is not Ending.WRONG:
        return "no shape"
    if math.isfinite(verdict.error):
        return f"off {verdict.error:.2g}"
    if verdict.sentence.startswith("no answer"):
        return f"no answer in {PATIENCE:g} s"
    return verdict.sentence.removeprefix("the process ").rpartition(": ")[2]
