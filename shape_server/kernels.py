"""The compiled path: every function that numba compiles and the solver calls, under one name."""

from __future__ import annotations

from .band import eliminate as eliminate
from .border import border_rows as border_rows
from .chain import carried_forces as carried_forces
from .chain import directors as directors
from .chain import interpolate_frames as interpolate_frames
from .chain import positions as positions
from .chain import retract as retract
from .closing import close as close
from .contact_geometry import contact_geometry as contact_geometry
from .curve import frames_along as frames_along
from .curve import sagging_tangents as sagging_tangents
from .curve import turn_onto as turn_onto
from .drag import drag_limit as drag_limit
from .drag import normal_forces as normal_forces
from .elimination import columns as columns
from .elimination import factor_and_solve as factor_and_solve
from .equilibrium import begin_stiffness as begin_stiffness
from .equilibrium import descend as descend
from .equilibrium import kick as kick
from .equilibrium import settle as settle
from .half_cells import lacking as lacking
from .half_cells import mend as mend
from .inclined import add_couples as add_couples
from .iteration import iterate as iterate
from .margin import smallest_stiffness as smallest_stiffness
from .newton import border_columns as border_columns
from .newton import linear_system as linear_system
from .newton import newton_step as newton_step
from .newton import unbalanced as unbalanced
from .rod import energy as energy
from .rod import look as look
from .rod import node_forces as node_forces
from .section_forces import section_forces as section_forces
from .section_forces import twist_of as twist_of
from .smoothing import add_smoothing as add_smoothing
from .smoothing import smoothing_energy as smoothing_energy
from .stick_slip import stick_slip as stick_slip
from .symmetric import solve_symmetric as solve_symmetric
from .vertices import assemble as assemble
from .vertices import elastic_energy as elastic_energy
