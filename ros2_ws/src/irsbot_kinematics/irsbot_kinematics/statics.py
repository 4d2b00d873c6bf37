"""Forces between platform and legs, from the unit actuation screws alone. No inverse: cofactors and a determinant.

Sign convention of all mechanisms: R_i is the force of leg i on the platform along its screw, w the external wrench,
A^T R + w = 0; motor efforts tau = -B R, so that tau.qdot + w.t = 0. A screw row has 2 entries (force in a plane),
3 (force in space, or force in a plane and moment; `attachments` tells the two apart) or 4 (force in space, moment about
z).
"""

from __future__ import annotations

from collections.abc import Sequence

from irsbot_kinematics.numerics.arithmetic import Arithmetic, N

Rows = Sequence[Sequence[N]]


def cofactors(rows: Rows[N]) -> tuple[N, tuple[tuple[N, ...], ...]]:
    """Determinant of A and, per row i, the vector C_i with A_i . C_i = det and A_j . C_i = 0: column i of adj(A).

    rows: n x n with n = 2, 3 or 4. C_i / det is the platform twist when only leg i yields by one unit.
    """
    if len(rows) == 2:
        (ax, ay), (bx, by) = rows
        return ax * by - ay * bx, ((by, -bx), (-ay, ax))
    if len(rows) == 3:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = rows
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        return ax * px + ay * py + az * pz, ((px, py, pz), (qx, qy, qz), (rx, ry, rz))
    a, b, c, d = rows
    first, last = _minors(a, b), _minors(c, d)
    columns = (_wedge(b, last), _wedge(a, last, -1.0), _wedge(d, first), _wedge(c, first, -1.0))
    return _dot(a, columns[0]), columns


def pressure_cosines(k: Arithmetic[N], rows: Rows[N], attachments: Sequence[tuple[N, N]]) -> tuple[N, tuple[N, ...]]:
    """Determinant of A, and cosine of the pressure angle of each leg, 0..1, 0 at a Type 2 singularity.

    The pressure angle of leg i lies between its force and the velocity of the point where it holds the platform
    while the other actuators stand still ([2], section 2): |det A| over the size of that velocity times det A.
    `attachments`: that point seen from the platform point, one (x, y) per leg, where the platform can turn; else empty.
    A leg whose point cannot move (all cofactors zero) has cosine 0.
    """
    if len(rows) == 2:  # unit rows: both legs share |sin| of the angle between their screws
        (ax, ay), (bx, by) = rows
        cross = ax * by - ay * bx
        cosine = k.minimum(k.abs(cross), 0.0 * cross + 1.0)  # rounding may lift it over 1, where acos ends
        return cross, (cosine, cosine)
    det, speeds = yielding(k, rows, attachments)
    size = k.abs(det)
    return det, tuple([k.ratio(size, speed) for speed in speeds])


def yielding(k: Arithmetic[N], rows: Rows[N], attachments: Sequence[Sequence[N]]) -> tuple[N, list[N]]:
    """Determinant of A, and, per leg, its size times that of the velocity with which the point where the leg holds the
    platform moves when this leg alone yields by one unit. `attachments` as in `pressure_cosines`."""
    det, columns = cofactors(rows)
    if attachments and len(rows) == 4:
        return det, [
            _size(k, (vx - w * ay, vy + w * ax, vz))
            for (vx, vy, vz, w), (ax, ay) in zip(columns, attachments, strict=True)
        ]
    if attachments:
        return det, [
            k.hypot(vx - w * ay, vy + w * ax) for (vx, vy, w), (ax, ay) in zip(columns, attachments, strict=True)
        ]
    return det, [_size(k, column) for column in columns]


def twist(rows: Rows[N], drive: Sequence[N]) -> tuple[N, ...]:
    """Platform twist t of A t = drive, with drive = -B qdot: the same units as the task coordinates per second.

    Undefined at Type 2 (det A = 0): the caller excludes that case.
    """
    if len(rows) == 2:
        (ax, ay), (bx, by) = rows
        cross = ax * by - ay * bx
        return (by * drive[0] - ay * drive[1]) / cross, (ax * drive[1] - bx * drive[0]) / cross
    det, columns = cofactors(rows)
    return combined(det, columns, drive)


def combined(det: N, columns: Rows[N], drive: Sequence[N]) -> tuple[N, ...]:
    """The twist of `twist` from cofactors of 3 or 4 rows: the sum of drive_i C_i, over det."""
    if len(columns) == 3:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = columns
        a, b, c = drive
        return (a * ax + b * bx + c * cx) / det, (a * ay + b * by + c * cy) / det, (a * az + b * bz + c * cz) / det
    (ax, ay, az, aw), (bx, by, bz, bw), (cx, cy, cz, cw), (dx, dy, dz, dw) = columns
    a, b, c, d = drive
    return (
        (a * ax + b * bx + c * cx + d * dx) / det,
        (a * ay + b * by + c * cy + d * dy) / det,
        (a * az + b * bz + c * cz + d * dz) / det,
        (a * aw + b * bw + c * cw + d * dw) / det,
    )


def reactions(rows: Rows[N], wrench: Sequence[N]) -> tuple[N, ...]:
    """Force of each leg on the platform, N, that balances an external wrench: R = -A^-T w.

    wrench: N, and N m about the platform point if the platform can turn. Undefined at Type 2 (det A = 0): the caller
    excludes that case.
    """
    det, columns = cofactors(rows)
    return tuple([-_dot(column, wrench) / det for column in columns])


def efforts(levers: Sequence[N], forces: Sequence[N]) -> tuple[N, ...]:
    """Motor efforts, N m or N, of leg forces: tau = -B R."""
    return tuple([-lever * force for lever, force in zip(levers, forces, strict=True)])


def reaction_max(
    k: Arithmetic[N], rows: Rows[N], force_n: float, moment_nm: float = 0.0, *, turns: bool = False
) -> tuple[N, ...]:
    """Largest size of each leg force, N, over all directions of an external force and both signs of a moment.

    Planar with rotation ([S2] (8) in cofactor form): (f hypot(C_x, C_y) + |m| |C_z|)/|det|. Without rotation:
    f |C|/|det|, where a moment does not matter. `turns`: the last entry of a row is a moment.
    Infinite at Type 2.
    """
    if len(rows) == 2:  # unit rows: the cofactor vectors are unit vectors
        (ax, ay), (bx, by) = rows
        size = k.abs(ax * by - ay * bx)
        largest = k.quotient(0.0 * size + force_n, size)
        return largest, largest
    det, columns = cofactors(rows)
    size = k.abs(det)
    if turns:
        sizes = [_size(k, v[:-1]) * force_n + k.abs(v[-1]) * abs(moment_nm) for v in columns]
    else:
        sizes = [_size(k, v) * force_n for v in columns]
    return tuple([k.quotient(value, size) for value in sizes])


def _size(k: Arithmetic[N], v: Sequence[N]) -> N:
    if len(v) == 2:
        return k.hypot(v[0], v[1])
    return k.safe_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def _dot(a: Sequence[N], b: Sequence[N]) -> N:
    total = a[0] * b[0] + a[1] * b[1]
    for x, y in zip(a[2:], b[2:], strict=True):
        total = total + x * y
    return total


def _minors(a: Sequence[N], b: Sequence[N]) -> tuple[N, ...]:
    """The 2 x 2 determinants of two rows of 4, columns 01, 02, 03, 12, 13, 23."""
    a0, a1, a2, a3 = a
    b0, b1, b2, b3 = b
    return (
        a0 * b1 - a1 * b0,
        a0 * b2 - a2 * b0,
        a0 * b3 - a3 * b0,
        a1 * b2 - a2 * b1,
        a1 * b3 - a3 * b1,
        a2 * b3 - a3 * b2,
    )


def _wedge(b: Sequence[N], cd: Sequence[N], sign: float = 1.0) -> tuple[N, ...]:
    """The vector whose product with any row a is sign times the determinant of a, b and the two rows with minors cd."""
    b0, b1, b2, b3 = b
    m01, m02, m03, m12, m13, m23 = cd
    return (
        sign * (b1 * m23 - b2 * m13 + b3 * m12),
        sign * (b2 * m03 - b0 * m23 - b3 * m02),
        sign * (b0 * m13 - b1 * m03 + b3 * m01),
        sign * (b1 * m02 - b0 * m12 - b2 * m01),
    )
