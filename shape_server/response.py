"""How a settled rod answers small motions of its grasps: one more solve with the same elimination.

At an equilibrium g(theta, y, p) = 0 and r(theta, y, p) = 0, with p the poses of the grasps. The turn and the change of the forces
with a pose solve the system of a Newton step with other right-hand sides,

    [ H    -C ] [ theta ]     [ -dg/dp ]         dg/dp: the frame of a clamp turns the end of its half cell, that of a guide its force
    [ r_th  B ] [ y     ]  =  [ -dr/dp ]         dr/dp: the goal of a row moves, or all positions do with the base

H and C are those of `newton` and `axial`. Of a contact that pushes with the force f along u, at the share x of its segment and with
the couple m about its axes, all of f u, x and m are unknowns of the border, tied to the cable by the slopes of `contact_slopes`. What
does not push has no rows.

H is symmetric, the second derivative along exp(theta). Where a segment bears a couple m, elastic slope and couple cancel only together,
and the slope of the first has half of m x theta beside H; the unknown of the couple takes that in. In the same way the moment at a
clamp, R dE/dphi, changes by R (E_phi_phi phi + E_phi_theta theta + phi x E_phi / 2) with the turn phi of the clamp in its own axes.
Derived here, checked by differences in the tests.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Grasps

from .band import eliminate
from .border import SOFTNESS
from .chain import retract
from .contact_slopes import COUPLE, DIRECTION, GAP, LENGTH, NODE, PLACE, TURNS, ContactSlopes, contact_slopes
from .newton import fix_gauge, linear_system
from .numpy_path import directors
from .rod import Rod, State, View
from .section_forces import section_forces
from .system import System
from .vertices import CLAMP, vertex

Array = np.ndarray
CLAMP_TURN: Final = 3e-5  # rad; leaves 1e-9 of the slopes, as rounding does
PUSH, FORCE, SHIFT, MOMENT = 0, slice(1, 4), 4, slice(5, 8)  # unknowns of a contact


class Motion(NamedTuple):
    """What moves, for every column."""

    turn: Array  # (n-1, 3, k) rad, of the segments about their own axes
    longer: Array  # (n-1, k) m
    nodes: Array  # (n, 3, k) m


class Side(NamedTuple):
    """The half cell beside a clamp: slopes of its moments, world frame, with the turn of the clamp about the world's axes."""

    clamp: int
    segment: int
    mixed: Array  # (3, 3) N m, on the segment about its own axes
    own: Array  # (3, 3) N m, on the clamp


class Column(NamedTuple):
    """Numbers of the columns and rows: unknowns of the border first, held points, then eight for every contact; then the poses."""

    held: Array  # (h,) int, rows of `Held` that are active
    contacts: ContactSlopes
    guided: list[tuple[int, int]]  # rows of guides, and the grasp of each
    border: int  # unknowns of the border
    poses: int

    def contact(self, number: int) -> int:
        """First unknown of a contact."""
        return len(self.held) + 8 * number


def response(system: System, grasps: Grasps, state: State, view: View) -> tuple[Array, Array]:
    """Changes of the nodes (n, 3, 6 g) and of the wrenches at all grasps (6 g, 6 g) with the grasps' poses.

    Poses and wrenches in the order of the grasps, positions and forces first, then turns about the world's axes and moments.

    Args:
        system: The equations.
        grasps: Whose poses change.
        state: A stable equilibrium, exactly.
        view: Of that state.
    """
    rod = system.rod
    contacts = contact_slopes(rod, state, view)
    held = np.flatnonzero(np.append(state.holds, True)[rod.held.rows["bond"]])  # a row of a grasp has the last, which always holds
    guided = [(row, k) for row, k in enumerate(system.row_grasp.tolist()) if k >= 0 and grasps.hold[k] is Hold.GUIDE]
    column = Column(held, contacts, guided, len(held) + 8 * len(contacts.rows), 6 * len(grasps.s))
    grasp_of_clamp = [k for k, hold in enumerate(grasps.hold) if hold is not Hold.HINGE]
    carried, _, diagonal, upper, beyond = linear_system(rod, state, view)
    fix_gauge(rod, diagonal, 0.0)
    spread = _spread(system, column, state, view)
    right = _columns(rod, view, carried, diagonal, spread)
    for k, row in enumerate(contacts.rows):
        right[rod.touch["element"][row], :, column.contact(k) + 5 : column.contact(k) + 8] += np.eye(3)
    sides = list(_smoothed_sides(rod, state, view) if len(rod.elastic.smoothing) else _sides(rod, state))
    for side in sides:
        at = column.border + 6 * grasp_of_clamp[side.clamp] + 3
        right[side.segment, :, at : at + 3] -= side.mixed
    eliminate(diagonal, upper, beyond, right)
    motion = _motion(system, column, view, carried, spread, right)
    rows = np.vstack([_held_rows(system, column, grasps.position, view, motion), *_contact_rows(rod, column, state, motion)])
    border = -np.linalg.solve(rows[:, : column.border], rows[:, column.border :])
    turn, _, nodes = (part[..., column.border :] + part[..., : column.border] @ border for part in motion)
    wrenches = _forces(system, column, state, border)
    for side in sides:
        at = 6 * grasp_of_clamp[side.clamp] + 3
        wrenches[at : at + 3] += side.mixed.T @ turn[side.segment]
        wrenches[at : at + 3, at : at + 3] += side.own
    return nodes, wrenches


def _spread(system: System, column: Column, state: State, view: View) -> Array:
    """What a unit of every column hands on towards the base, (n-1, 3, columns) [N]: forces of the border, turned forces of guides."""
    rod = system.rod
    out = np.zeros((len(rod.lengths), 3, column.border + column.poses))
    touching = column.contacts.rows
    shares = _shares(rod, rod.held.rows["element"], rod.held.rows["fraction"])
    out[:, :, : len(column.held)] = np.einsum("jh,hx->jxh", shares[:, column.held], rod.held.rows["axis"][column.held])
    places = _shares(rod, rod.touch["element"][touching], state.fraction[touching])
    for k, row in enumerate(touching):
        at = column.contact(k)
        out[:, :, at + 1 : at + 4] = places[:, k, None, None] * np.eye(3)
        out[rod.touch["element"][row], :, at + SHIFT] = state.push[row] * view.push[row]
    for row, grasp in column.guided:
        at = column.border + 6 * grasp + 3
        turned = np.cross(np.eye(3), state.force[row] * rod.held.rows["axis"][row])  # rows: by a turn about each axis
        out[:, :, at : at + 3] += shares[:, row, None, None] * turned.T
    return out


def _shares(rod: Rod, element: Array, fraction: Array) -> Array:
    """Share (n-1, m) of every segment in the way from the base to the places; negative behind the base."""
    j = np.arange(len(rod.lengths))[:, None]
    ahead = np.where(j == element, fraction, 1.0) * ((j >= rod.base) & (j <= element))
    behind = np.where(j == element, 1.0 - fraction, 1.0) * ((j < rod.base) & (j >= element))
    return np.asarray(ahead - behind)


def _slope(view: View, carried: Array) -> Array:
    """Change (n-1, 3) [N] of the tension of every segment with its turn."""
    across = np.einsum("jkx,jx->jk", view.axes, carried)
    return np.stack([-across[:, 1], across[:, 0], np.zeros(len(carried))], axis=1)


def _give(rod: Rod) -> Array:
    return rod.give if len(rod.give) else np.zeros(len(rod.lengths))


def _columns(rod: Rod, view: View, carried: Array, diagonal: Array, spread: Array) -> Array:
    """Columns (n-1, 3, columns) of the forces `spread`, see `axial`; what stretch adds goes to `diagonal` too."""
    give, slope = _give(rod), _slope(view, carried)
    diagonal -= give[:, None, None] * slope[:, :, None] * slope[:, None, :]
    along = np.einsum("jkx,jxc->jkc", view.axes, spread)
    out = (give[:, None] * along[:, 2])[:, None, :] * slope[:, :, None]
    out[:, 0] -= view.lengths[:, None] * along[:, 1]
    out[:, 1] += view.lengths[:, None] * along[:, 0]
    return np.ascontiguousarray(out)


def _motion(system: System, column: Column, view: View, carried: Array, spread: Array, turn: Array) -> Motion:
    """How segments and nodes move as segments turn, tensions change and the base moves."""
    rod, axes = system.rod, view.axes
    pulled = np.einsum("jk,jkc->jc", _slope(view, carried), turn) + np.einsum("jx,jxc->jc", axes[:, 2], spread)
    longer = _give(rod)[:, None] * pulled
    edges = turn[:, 1, None, :] * axes[:, 0, :, None] - turn[:, 0, None, :] * axes[:, 1, :, None]
    edges = view.lengths[:, None, None] * edges + longer[:, None, :] * axes[:, 2, :, None]
    nodes = np.concatenate([np.zeros((1, *edges.shape[1:])), np.cumsum(edges, axis=0)])
    nodes -= nodes[rod.base].copy()
    at = column.border + 6 * system.base
    nodes[:, :, at : at + 3] += np.eye(3)
    return Motion(turn, longer, nodes)


def _held_rows(system: System, column: Column, position: Array, view: View, motion: Motion) -> Array:
    """Change (h, columns) [m] of the misses of all held points."""
    held, chosen = system.rod.held, column.held
    element, fraction, axis = held.rows["element"][chosen], held.rows["fraction"][chosen], held.rows["axis"][chosen]

    def along(nodes: Array) -> Array:
        """Of values (n, ...) at the nodes, those at the held points (h, ...)."""
        return np.asarray(((1.0 - fraction) * nodes[element].T + fraction * nodes[element + 1].T).T)

    out = np.asarray(np.einsum("hx,hxc->hc", axis, along(motion.nodes)))
    for k, grasp in enumerate(system.row_grasp[chosen].tolist()):
        if grasp >= 0:
            at = column.border + 6 * grasp
            out[k, at : at + 3] -= axis[k]
        else:
            out[k, k] += SOFTNESS / system.rod.force_scale
    slid, where = along(view.nodes), {row: k for k, row in enumerate(chosen.tolist())}
    for row, grasp in column.guided:
        at = column.border + 6 * grasp + 3
        out[where[row], at : at + 3] += np.cross(held.rows["axis"][row], slid[where[row]] - position[grasp])
    return out


def _contact_rows(rod: Rod, column: Column, state: State, motion: Motion) -> Iterator[Array]:
    """Rows (8, columns) of every contact: its gap is what its softness says, its force, place and couple what the slopes say."""
    last = len(rod.lengths) - 1
    for k, row in enumerate(column.contacts.rows):
        j, at, push = rod.touch["element"][row], column.contact(k), state.push[row]
        numbers, slopes = column.contacts.numbers[k], column.contacts.slopes[k]
        # The slopes with a neighbour that does not exist are zero.
        beside = motion.turn[[max(j - 1, 0), j, min(j + 1, last)]].reshape(9, -1)
        changes = slopes[:, NODE] @ motion.nodes[j] + slopes[:, TURNS] @ beside + slopes[:, LENGTH, None] * motion.longer[j]
        out = np.zeros((8, column.border + column.poses))
        out[PUSH] = changes[GAP]
        out[FORCE] = -push * changes[DIRECTION]
        out[SHIFT] = -changes[PLACE]
        out[MOMENT] = -push * changes[COUPLE] + 0.5 * push * np.cross(numbers[COUPLE], motion.turn[j], axisb=0).T
        own = out[:, at : at + 8]
        own[PUSH, PUSH] += SOFTNESS / rod.force_scale
        own[FORCE, PUSH] -= numbers[DIRECTION]
        own[MOMENT, PUSH] -= numbers[COUPLE]
        own[1:, 1:] += np.eye(7)
        yield out


def _forces(system: System, column: Column, state: State, border: Array) -> Array:
    """Change (6 g, 6 g) of the forces at the grasps; that of the base is what is left over from all others."""
    out, held = np.zeros((column.poses, column.poses)), system.rod.held
    rest = 6 * system.base
    for k, row in enumerate(column.held):
        grasp, change = system.row_grasp[row], held.rows["axis"][row][:, None] * border[k]
        out[rest : rest + 3] -= change
        if grasp >= 0:
            out[6 * grasp : 6 * grasp + 3] += change
    for k in range(len(column.contacts.rows)):
        out[rest : rest + 3] -= border[column.contact(k) + 1 : column.contact(k) + 4]
    for row, grasp in column.guided:
        at, turned = 6 * grasp, np.cross(np.eye(3), state.force[row] * held.rows["axis"][row]).T
        out[at : at + 3, at + 3 : at + 6] += turned
        out[rest : rest + 3, at + 3 : at + 6] -= turned
    return out


def _sides(rod: Rod, state: State) -> Iterator[Side]:
    """Half cells beside clamps."""
    matrices = np.swapaxes(directors(rod.clamp_frames), 1, 2)
    for node in np.flatnonzero(rod.clamp_of_node >= 0).tolist():
        clamp = int(rod.clamp_of_node[node])
        for segment in (node - 1, node):
            if not 0 <= segment < len(rod.lengths):
                continue
            pair, is_last = (state.frames[segment], rod.clamp_frames[clamp]), segment < node
            first, second = pair if is_last else pair[::-1]
            ga, gb, (haa, hab, hbb) = np.empty(3), np.empty(3), np.empty((3, 3, 3))
            law, bent, cell = rod.elastic.law[segment], rod.elastic.bent[segment], 0.5 * rod.lengths[segment]
            vertex(first, second, cell, CLAMP, law, bent, np.empty(4), ga, gb, haa, hab, hbb, np.empty((4, 3, 3)))
            slope, own, mixed = (gb, hbb, hab) if is_last else (ga, haa, hab.T)
            x, y, z = 0.5 * slope
            half = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # of phi x slope is this times phi
            world = matrices[clamp]
            yield Side(clamp, segment, mixed @ world.T, world @ (own + half) @ world.T)


def _smoothed_sides(rod: Rod, state: State, view: View) -> Iterator[Side]:
    """The same with a micro-structure length, by which a clamp is felt two segments away: slopes by central differences."""
    inward, segments = directors(rod.clamp_frames), range(len(rod.lengths))
    for clamp in range(len(rod.clamp_frames)):
        mixed, own = np.zeros((len(rod.lengths), 3, 3)), np.zeros((3, 3))
        for k in range(3):
            for sign in (1.0, -1.0):
                turn = np.zeros((len(inward), 3))
                turn[clamp] = sign * CLAMP_TURN * inward[clamp, :, k]
                turned = rod._replace(clamp_frames=retract(rod.clamp_frames, turn))
                mixed[:, :, k] += sign * linear_system(turned, state, view)[1] / (2.0 * CLAMP_TURN)
                own[:, k] += sign * section_forces(turned, state, view)[3][clamp] / (2.0 * CLAMP_TURN)
        felt = [segment for segment in segments if mixed[segment].any()]
        for segment in felt:
            yield Side(clamp, segment, mixed[segment], own if segment == felt[0] else np.zeros((3, 3)))
