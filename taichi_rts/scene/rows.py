"""How far apart rows of particles begin: such that whole numbers of them fill the fluids, and fit between walls.

All particles of a scene have one mass, so all its blocks of fluid share one lattice: its rows are `Rows.steps` apart, a
distance for each axis. Where every block's size is a multiple of the spacing that is the spacing itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from taichi_rts.scene.fluids.block import Block
from taichi_rts.scene.fluids.particles import Particles
from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.fluids.shapes import separation
from taichi_rts.scene.scales import SceneScales
from taichi_rts.scene.validation import Vector

MOST_FITTED = 0.05
"""By how much of the spacing rows may be further apart, or closer, so that a whole number fits a block's side."""
CLOSEST, WIDEST = 0.9, 1.25
"""Limits [spacings] of rows where fluid reaches from wall to wall, and would leave a gap otherwise: pools that are 2.5 to 20
spacings wide rest with rows 0.92 to 1.25 apart, with 0.88 they lose pressure, with 1.33 they keep moving."""
MOST_TRIED = 16
"""Blocks, the largest, whose sides rows are tried to fit."""
SLACK = 1e-6
"""Share of the spacing that counts as rounding of lengths."""


@dataclass(frozen=True)
class Rows:
    """The lattice of a scene's fluid: distances of its rows [m], (dim,), and the fluids with sides that are multiples of them."""

    steps: Vector
    fluids: tuple[FluidShape, ...]

    @property
    def spacing(self) -> float:
        """Spacing [m] of a cubic (square) lattice of the same cells: with it, particles given one by one have the same mass."""
        return self.steps[0] if len(set(self.steps)) == 1 else self.cell ** (1.0 / len(self.steps))

    @property
    def cell(self) -> float:
        """Volume [m^dim] of the lattice at each particle."""
        return math.prod(self.steps)


def fit_rows(scene: SceneScales, spacing: float | None = None) -> Rows:
    """Return the lattice on which the scene's fluid begins, or would with another `spacing` [m].

    Along an axis on which fluid reaches from wall to wall, a whole number of rows fits between the walls; else the rows' distance
    is that which divides the blocks' sides with the least volume gained or lost, both within the limits above. What is left
    is rounded to the nearest row, and a side that ends at two walls to the next lower number. Blocks that touch keep a common
    face. Where particles are given one by one, which have the mass of the spacing, nothing is fitted.
    """
    lattice = [k for k, fluid in enumerate(scene.fluids) if isinstance(fluid, Block)]
    spacing = scene.spacing if spacing is None else spacing
    if not lattice or any(isinstance(fluid, Particles) for fluid in scene.fluids):
        return Rows((spacing,) * scene.dim, scene.fluids)
    blocks: list[Any] = [scene.fluids[k] for k in lattice]
    steps, corners = [], [(list(block.lower), list(block.upper)) for block in blocks]
    for fitted in _axes(scene, spacing, blocks):
        axis = fitted.axis
        steps.append(fitted.step)
        if not fitted.is_regular:
            for (lower, upper), (a, b) in zip(corners, fitted.faces(), strict=True):
                lower[axis], upper[axis] = a, b
    fluids = list(scene.fluids)
    for k, block, (lower, upper) in zip(lattice, blocks, corners, strict=True):
        if (tuple(lower), tuple(upper)) != (block.lower, block.upper):
            fluids[k] = replace(block, lower=tuple(lower), upper=tuple(upper))
    return Rows(tuple(steps), tuple(fluids))


def cell_volume(scene: SceneScales, spacing: float) -> float:
    """Volume [m^dim] of the lattice at each particle with another `spacing` [m], also of a scene that may contradict itself."""
    fluids = scene.fluids
    whole = all(len(fluid.lower) == scene.dim for fluid in fluids)
    blocks = [fluid for fluid in fluids if isinstance(fluid, Block)]
    if not whole or not blocks or any(isinstance(fluid, Particles) for fluid in fluids):
        return spacing**scene.dim
    return math.prod(axis.step for axis in _axes(scene, spacing, blocks))


def _axes(scene: SceneScales, spacing: float, blocks: Sequence[Block]) -> list[_Axis]:
    return [_Axis(scene, spacing, axis, blocks) for axis in range(scene.dim)]


def is_multiple(length: float, step: float) -> bool:
    """Whether `length` [m] is a whole number of `step` [m], but for rounding."""
    count = length / step
    return abs(count - round(count)) <= SLACK + 1e-9 * count


class _Axis:
    """Blocks of fluid along one axis, and the distance [m] of rows that suits them."""

    def __init__(self, scene: SceneScales, spacing: float, axis: int, blocks: Sequence[Block]) -> None:
        self.scene = scene
        self.spacing = spacing
        self.axis = axis
        self.blocks = blocks
        self.low, self.high = scene.domain.lower[axis], scene.domain.upper[axis]
        self.sides = [(block.lower[axis], block.upper[axis]) for block in blocks]
        self.slack = SLACK * spacing
        self.is_regular = all(is_multiple(b - a, spacing) for a, b in self.sides)
        self.step = spacing if self.is_regular or scene.is_periodic[axis] else self._choose()

    def _choose(self) -> float:
        s = self.spacing
        if self._reach_across():
            across = self.high - self.low
            step = across / max(1, math.floor(across / s + 0.5))
            if step < CLOSEST * s:
                step = across / max(1, math.floor(across / s))
            return step if step <= WIDEST * s else s
        lengths = [b - a for a, b in self.sides]
        largest = sorted(range(len(lengths)), key=lambda k: -self.blocks[k].volume)[:MOST_TRIED]
        even = {lengths[k] / max(1, math.floor(lengths[k] / s + 0.5)) for k in largest}
        choices = [s, *(min(max(step, (1.0 - MOST_FITTED) * s), (1.0 + MOST_FITTED) * s) for step in sorted(even))]
        choices = [step for step in choices if step <= min(lengths) + self.slack] or [s]

        def lost(step: float) -> float:
            rounded = [step * math.floor(length / step + 0.5 + SLACK) / length for length in lengths]
            return sum(
                block.volume * abs(share - 1.0) for block, share in zip(self.blocks, rounded, strict=True)
            ) / sum(block.volume for block in self.blocks)

        return min(choices, key=lambda step: (round(lost(step), 9), abs(step - s)))

    def _reach_across(self) -> bool:
        """Whether the blocks, one behind the other, reach from wall to wall."""
        reached = self.low
        for a, b in sorted(self.sides):
            if a > reached + self.slack:
                return False
            reached = max(reached, b)
        return reached >= self.high - self.slack

    def faces(self) -> list[tuple[float, float]]:
        """Lower and upper face [m] of each block, moved so that a whole number of rows lies between them."""
        step, found = self.step, [(0.0, 0.0)] * len(self.sides)
        most = (self.high - self.low) / step * (1.0 + 1e-9) + SLACK
        for group in self._groups():
            lower, upper = min(self.sides[k][0] for k in group), max(self.sides[k][1] for k in group)
            at_upper_wall = abs(upper - self.high) < self.slack and abs(lower - self.low) >= self.slack
            anchor = self.high if at_upper_wall else lower
            first = math.ceil((self.low - anchor) / step - SLACK)
            last = math.floor((self.high - anchor) / step * (1.0 + 1e-9) + SLACK)
            for k in group:
                a, b = ((x - anchor) / step for x in self.sides[k])
                if self._near_others(self.blocks[k]):
                    start, end = math.ceil(a - SLACK), math.floor(b + SLACK)
                else:
                    start, end = math.floor(a + 0.5 + SLACK), math.floor(b + 0.5 + SLACK)
                start, end = max(start, first), min(end, last, start + math.floor(most))
                end = max(end, start + 1)
                found[k] = anchor + start * step, anchor + end * step
        return found

    def _near_others(self, block: Block) -> bool:
        """Whether fluid of another shape lies less than a row from the block, which may then only shrink."""
        return any(
            not isinstance(fluid, Block) and separation(block, fluid) < self.step * (1.0 + SLACK)
            for fluid in self.scene.fluids
        )

    def _groups(self) -> list[list[int]]:
        """Numbers of the blocks that lie less than a row behind each other, and so share their rows."""
        owner = list(range(len(self.sides)))

        def root(k: int) -> int:
            while owner[k] != k:
                k = owner[k]
            return k

        order = sorted(owner, key=lambda k: self.sides[k][0])
        for k in order:
            for n in order:
                gap = self.sides[n][0] - self.sides[k][1]
                if gap >= self.step:
                    break
                if gap >= -self.slack and self._face(self.blocks[k], self.blocks[n]):
                    owner[root(n)] = root(k)
        groups: dict[int, list[int]] = {}
        for k in order:
            groups.setdefault(root(k), []).append(k)
        return list(groups.values())

    def _face(self, one: Block, two: Block) -> bool:
        """Whether two blocks are in front of each other: they overlap, or nearly, along all other axes."""
        return all(
            d == self.axis or (one.lower[d] < two.upper[d] + self.step and two.lower[d] < one.upper[d] + self.step)
            for d in range(self.scene.dim)
        )
