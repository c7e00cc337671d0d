"""The numbers of a cable from measured points of its shape, with how well each is determined."""

from __future__ import annotations

from .fit import Calibration as Calibration
from .fit import calibrate as calibrate
from .interval import Interval as Interval
from .measured import Measured as Measured
from .measured import read_points as read_points
