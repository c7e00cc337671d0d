"""A twisted ring leaves its plane at 2 pi sqrt(3) EI / GJ, to a thousandth: Zajac 1962.

Source: Zajac 1962, "Stability of two planar loop elasticas", Journal of Applied Mechanics 29, 136-142; Michell 1889, "On the stability
of a bent and twisted wire", Messenger of Mathematics 11, 181-184.

Claim: as in `test_ring_michell_1889`, where the threshold is derived a second time from the linearised rod. There a weight of a hundredth
of EI / L^2 keeps the ring from swinging and blurs the threshold; here it is a ten-thousandth, on 200 segments.
"""

from __future__ import annotations

import pytest
import test_ring_michell_1889 as michell

from protocol.messages import Shape


@pytest.fixture(autouse=True)
def _light_and_fine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(michell, "WEIGHT", 1e-4)
    monkeypatch.setattr(michell, "SEGMENTS", 200)


def settled(twist: float, part: float) -> tuple[Shape, bool]:
    angle = part * michell.critical(twist)
    shape = michell.settled_from_the_ring(twist, angle)
    return shape, michell.is_the_ring(shape, twist, angle)


@pytest.mark.parametrize("twist", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("part", [0.99, 0.998, 0.999])
def test_a_ring_a_thousandth_below_the_threshold_stays(twist: float, part: float) -> None:
    shape, stays = settled(twist, part)
    assert stays, shape.sentence
    assert shape.is_stable


@pytest.mark.parametrize("twist", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("part", [1.001, 1.002])
def test_a_ring_a_thousandth_above_the_threshold_does_not(twist: float, part: float) -> None:
    shape, stays = settled(twist, part)
    assert not stays, shape.sentence
