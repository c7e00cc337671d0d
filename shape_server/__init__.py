"""Boundary conditions in, cable shape out; no clock, no bodies, no memory."""

from __future__ import annotations

from .follower import Follower as Follower
from .many import FollowerBatch as FollowerBatch
from .many import solve_many as solve_many
from .sensitivity import Sensitivities as Sensitivities
from .sensitivity import sensitivities as sensitivities
from .solve import solve as solve
