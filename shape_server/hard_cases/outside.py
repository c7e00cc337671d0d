"""Asked for what a model does not cover: each must be told so in a sentence, or owned up to in metres, and never answered in silence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Final

import msgspec
import numpy as np

from protocol.hard_case import Case, Check, Unsound
from protocol.kinds import Hold, Model
from protocol.messages import PointLoads, Problem
from protocol.scene import LumpedMass, Section

from .answers import found
from .posing import ALONG_X, GRAVITY, Row, apart, cable, contacts, frame, grasps, span

FAMILY: Final = "outside the model"
ROD: Final = cable()
ASKEW: Final = grasps((0.0, (0, 0, 0), ALONG_X), (1.0, (0.9, 0.1, 0.0), frame((1.0, 1.0, 0.0))))
TOUCH: Final = contacts(Row(s=0.5, point=(0.3, 0.0, -0.3)))
AT_MIDDLE: Final = PointLoads(s=np.array([0.5]), force=np.array([[0.0, 0.1, 0.0]]))
PLAIN: Final = Problem(cable=ROD, grasps=span(0.9))
SOFT: Final = Problem(cable=cable(bending=1e-3), grasps=span(0.9))
UNSUPPORTED: Final = {
    "branches with contacts": msgspec.structs.replace(PLAIN, contacts=TOUCH, branch=2),
    "rod without bending": Problem(cable=cable(bending=None), grasps=span(0.9), model=Model.ROD),
    "taut line with contacts": msgspec.structs.replace(PLAIN, contacts=TOUCH, model=Model.TAUT),
    "taut line with a load": msgspec.structs.replace(PLAIN, loads=AT_MIDDLE, model=Model.TAUT),
    "taut line with a mass": Problem(cable=replace(ROD, masses=(LumpedMass(0.5, 1.0),)), grasps=span(0.9), model=Model.TAUT),
    "gradient cable askew": Problem(cable=ROD, grasps=ASKEW, model=Model.GRADIENT),
    "gradient cable with contacts": msgspec.structs.replace(PLAIN, contacts=TOUCH, model=Model.GRADIENT),
    "gradient cable in a guide": Problem(cable=ROD, grasps=span(0.9, hold=Hold.GUIDE), model=Model.GRADIENT),
    "gradient cable that stretches": Problem(cable=replace(ROD, stretch=1e4), grasps=span(0.9), model=Model.GRADIENT),
    "gradient cable in sections": Problem(
        cable=replace(ROD, sections=(Section(start=0.2, end=0.5, bending=0.1),)), grasps=span(0.9), model=Model.GRADIENT
    ),
    "taut line with a turn of twist": msgspec.structs.replace(SOFT, turns=(1,), model=Model.TAUT),
    "gradient cable with a turn of twist": msgspec.structs.replace(SOFT, turns=(1,), model=Model.GRADIENT),
    "catenary with a turn of twist": msgspec.structs.replace(SOFT, turns=(1,), model=Model.CATENARY),
    "catenary with sections": Problem(
        cable=replace(cable(bending=None), sections=(Section(start=0.2, end=0.5, mass_per_length=1.0),)), grasps=span(0.9)
    ),
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for name, problem in UNSUPPORTED.items():
        yield Case(name, FAMILY, partial(_unsupported, problem), may_decline=True)
    for chord in (0.999, 0.99, 0.9, 0.6, 0.3):
        for model in (Model.TAUT, Model.CATENARY, Model.GRADIENT):
            yield Case(f"{model.value} for a rod at {chord:g} of its length", FAMILY, partial(_cheaper, model, chord), may_decline=True)


def _unsupported(problem: Problem, path: ModuleType) -> Iterable[Check]:
    shape = found(problem, GRAVITY, path)
    raise Unsound(f"answered although it cannot be: {shape.sentence} ({shape.model})")


def _cheaper(model: Model, chord: float, path: ModuleType) -> Iterable[Check]:
    """A model that leaves bending out, or steep slopes, says by how much; right within a millimetre, or told."""
    problem = Problem(cable=cable(bending=1e-3), grasps=span(chord))
    exact = found(msgspec.structs.replace(problem, model=Model.ROD), GRAVITY, path, tolerance=1e-5)
    shape = found(msgspec.structs.replace(problem, model=model), GRAVITY, path)
    yield Check("distance from the rod", apart(shape, exact), 1e-3, told=shape.error or 0.0)
