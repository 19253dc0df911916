"""Compiled farthest-first selection with exact pruning.

Distances are float32 and summed in the order of `numpy.sum((a - b) ** 2, axis=1)` on rows of 60 (eight running sums,
added pairwise, then the remainder), so that a plain NumPy loop selects the same rows in the same order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

WIDTH = 60
"""Length of a row: 20 joints, three coordinates each."""


def _squared_distance(_: Any, a: Any, i: Any, b: Any, j: Any) -> Any:
    """Return typing and LLVM code of `squared_distance`: 6 ns; Numba alone does not vectorise the sums (50 ns)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        scalar = ir.FloatType()
        lanes = 8  # float32 numbers that one instruction adds
        vector = ir.VectorType(scalar, lanes)

        def row(array: int, index: int) -> Any:
            view = context.make_array(signature.args[array])(context, builder, args[array])
            width = cgutils.unpack_tuple(builder, view.shape)[1]
            return builder.gep(view.data, [builder.mul(args[index], width)])

        rows = row(0, 1), row(2, 3)

        def square(column: int, kind: Any) -> Any:
            offset = ir.Constant(ir.IntType(64), column)
            x, y = (builder.load(builder.bitcast(builder.gep(r, [offset]), kind.as_pointer()), align=4) for r in rows)
            difference = builder.fsub(x, y)
            return builder.fmul(difference, difference)

        blocks = WIDTH - WIDTH % lanes
        running = square(0, vector)
        for column in range(lanes, blocks, lanes):
            running = builder.fadd(running, square(column, vector))
        sums = [builder.extract_element(running, ir.Constant(ir.IntType(32), lane)) for lane in range(lanes)]
        while len(sums) > 1:
            sums = [builder.fadd(left, right) for left, right in zip(sums[::2], sums[1::2], strict=True)]
        total = sums[0]
        for column in range(blocks, WIDTH):
            total = builder.fadd(total, square(column, scalar))
        return total

    rows_type = types.Array(types.float32, 2, "C")
    if a != rows_type or b != rows_type:
        return None
    return types.float32(a, types.int64, b, types.int64), codegen


squared_distance: Any = intrinsic(_squared_distance)
"""`squared_distance(a, i, b, j)`, compiled code only: squared distance of float32 rows `a[i]` and `b[j]`, rounded as by
NumPy."""


@njit(cache=True)
def _open(slot: int, lists: Any) -> None:
    """Empty the list of a slot."""
    _, _, first, widest, farthest = lists
    first[slot] = -1
    widest[slot] = -1.0
    farthest[slot] = -1


@njit(cache=True)
def _hang(point: int, distance: np.float32, slot: int, lists: Any) -> None:
    """Add a point to the list of a slot."""
    nearest, following, first, widest, farthest = lists
    nearest[point] = distance
    following[point] = first[slot]
    first[slot] = point
    if distance > widest[slot] or (distance == widest[slot] and point < farthest[slot]):
        widest[slot] = distance
        farthest[slot] = point


@njit(cache=True)
def _share(
    slot: int, new: int, apart: float, stop: np.float32, points: np.ndarray, owners: np.ndarray, lists: Any
) -> None:
    """Move the points of `slot` that are nearer to the owner of slot `new`; drop those within `stop` of it.

    `apart` is a lower bound of the squared distance of the two owners.
    """
    nearest, following, first, _, _ = lists
    point = first[slot]
    _open(slot, lists)
    while point >= 0:
        after = following[point]
        old = nearest[point]
        target, distance = slot, old
        if apart < 4.0 * old:
            distance = squared_distance(points, point, owners, new)
            if distance < old:
                target = new
            else:
                distance = old
        if distance > stop:
            _hang(point, distance, target, lists)
        point = after


@njit(cache=True)
def _compact(active: int, owners: np.ndarray, lists: Any) -> tuple[int, int]:
    """Remove empty lists; return their number and the slot with the farthest point, lowest index first."""
    _, _, first, widest, farthest = lists
    best = 0
    slot = 0
    while slot < active:
        if first[slot] < 0:
            active -= 1
            owners[slot] = owners[active]
            first[slot] = first[active]
            widest[slot] = widest[active]
            farthest[slot] = farthest[active]
            continue
        if widest[slot] > widest[best] or (widest[slot] == widest[best] and farthest[slot] < farthest[best]):
            best = slot
        slot += 1
    return active, best


@njit(cache=True)
def farthest_first(points: np.ndarray, stop: np.float32, limit: int) -> np.ndarray:
    """Select rows of float32 `points` (N, 60), N at least 1: int64 indices in the order of selection.

    The selection starts with row 0. It adds the row farthest from all selected ones, the lowest index of equals, until
    no squared distance is above `stop` or `limit` rows are selected.

    Every candidate row is in the list of its nearest selected row, the list's owner. By the triangle inequality a new
    row c is nearer to a row p of owner a only if d(a, c) < 2 d(p, a), so a whole list is skipped if c is at least twice
    its radius away. A relative margin keeps this exact under rounding. Rows within `stop` are removed from the lists.
    """
    count = points.shape[0]
    limit = min(limit, count)
    order = np.empty(limit, np.int64)
    owners = np.empty((limit + 1, points.shape[1]), np.float32)
    lists = (
        np.empty(count, np.float32),  # squared distance of each row to its owner
        np.empty(count, np.int32),  # next row in the same list, -1 at its end
        np.empty(limit + 1, np.int32),  # per list: its first row,
        np.empty(limit + 1, np.float32),  # its squared radius,
        np.empty(limit + 1, np.int32),  # and the row at that radius
    )
    order[0] = 0
    selected = 1
    owners[0] = points[0]
    _open(0, lists)
    for point in range(1, count):
        distance = squared_distance(points, point, points, 0)
        if distance > stop:
            _hang(point, distance, 0, lists)
    active, best = _compact(1, owners, lists)
    safety = 1e-5  # relative margin of the pruning, five times the rounding error of a float32 sum of 60 squares
    tiny = 1e-35  # absolute margin in square metres, for squares that underflow
    while active > 0 and selected < limit:
        chosen = lists[4][best]
        order[selected] = chosen
        selected += 1
        owners[active] = points[chosen]
        _open(active, lists)
        for slot in range(active):
            apart = squared_distance(owners, slot, owners, active) * (1.0 - safety) - tiny
            if apart < 4.0 * lists[3][slot]:
                _share(slot, active, apart, stop, points, owners, lists)
        active, best = _compact(active + 1, owners, lists)
    return order[:selected].copy()
