"""SU2's FFD variables, control point by control point."""

from math import atan, comb, cos, radians, sin

import numpy as np


def rotated(point, origin, direction, angle):
    """A point turned about a line: P + cos (X-P) + (1-cos) (e.(X-P)) e + sin e x (X-P)."""
    e = np.array(direction) / np.linalg.norm(direction)
    arm = np.array(point) - origin
    return (
        origin
        + cos(angle) * arm
        + (1.0 - cos(angle)) * (e @ arm) * e
        + sin(angle) * np.cross(e, arm)
    )


def in_plane(first, end, corner):
    """Where the segment of a twist meets the plane y = y of a control point, or None."""
    first, end, shift = np.array(first), np.array(end), 1e-6 * np.ones(3)
    normal = np.array([1e-6, 1.0 + 1e-6, 1e-6])
    if normal @ (end - first) == 0.0:
        return None
    t = normal @ (corner + shift - first) / (normal @ (end - first))
    return first + t * (end - first) if 0.0 <= t <= 1.0 else None


def moved(kind, index, numbers, values, points, held=((), (), ()), relax=1.0, length=1.0, polar=0):
    """The control points (I, J, K, 3) after one variable, from those before it."""
    new = np.array(points, float)
    last = [count - 1 for count in new.shape[:3]]
    a = relax * values[0]
    every = [range(count) for count in new.shape[:3]]

    def fixed(*at):
        return any(one in planes for one, planes in zip(at, held, strict=True))

    if kind == "FFD_CONTROL_POINT":
        i, j, k = index
        by = [a * x for x in numbers] if any(numbers) else values
        lines = [one for one in range(3) if index[one] == -1]
        if fixed(i, j, k) or len(lines) == 3:
            return new
        for at in np.ndindex(*new.shape[:3]):
            if any(index[d] not in (-1, at[d]) for d in range(3)):
                continue
            if len(lines) == 1 and at[lines[0]] in held[lines[0]]:
                continue
            new[at] += by
    elif kind == "FFD_CONTROL_POINT_2D":
        first, second = index
        x, y = (a * numbers[0], a * numbers[1]) if any(numbers) else values[:2]
        if fixed(first, 0, second) if polar else fixed(first, second, 0):
            return new
        for i in every[0] if first == -1 else [first]:
            for layer in (0, 1):
                if polar:
                    new[i, layer, second] += (x, 0.0, y)
                    continue
                for j in every[1] if second == -1 else [second]:
                    new[i, j, layer] += (x, y, 0.0)
    elif kind in ("FFD_CAMBER", "FFD_THICKNESS"):
        i, j = index
        if fixed(i, j, 0) or fixed(i, j, 1):
            return new
        new[i, j, 0, 2] += a if kind == "FFD_CAMBER" else -a
        new[i, j, 1, 2] += a
    elif kind in ("FFD_CAMBER_2D", "FFD_THICKNESS_2D"):
        for k in (0, 1):
            new[index[0], 0, k, 1] += a if kind == "FFD_CAMBER_2D" else -a
            new[index[0], 1, k, 1] += a
    elif kind == "FFD_GULL":
        if index[0] not in held[1]:
            for i in every[0]:
                for k in every[2]:
                    new[i, index[0], k, 2] += a
    elif kind == "FFD_TWIST":
        j = index[0]
        centre = in_plane(numbers[:3], numbers[3:], points[0, j, 0])
        if j in held[1] or centre is None:
            return new
        for i in every[0]:
            for k in every[2]:
                if i not in held[0] and k not in held[2]:
                    new[i, j, k] = rotated(points[i, j, k], centre, (0, 1, 0), atan(a / length))
    elif kind in ("FFD_ROTATION", "FFD_CONTROL_SURFACE"):
        first, direction = np.array(numbers[:3]), np.subtract(numbers[3:], numbers[:3])
        angle = radians(a if kind == "FFD_ROTATION" else -a)
        for i, j, k in np.ndindex(*new.shape[:3]):
            if kind == "FFD_ROTATION" or (i <= last[0] - 2 and 2 <= j <= last[1] - 2):
                new[i, j, k] = rotated(points[i, j, k], first, direction, angle)
    elif kind == "FFD_NACELLE":
        i, j, k = index
        if index == (-1, -1, -1):
            return new
        for mirror in (False, True):
            row = last[1] - j if mirror and j != -1 else j
            if mirror and row == j != -1:
                break
            at = [i, row, k]
            if mirror:  # a loop leaves its index at the end
                at = [last[0] if i == -1 else i, 0 if j == -1 else row, last[2] if k == -1 else k]
            if fixed(*at):
                break
            for c in np.ndindex(*new.shape[:3]):
                if all(w in (-1, g) for w, g in zip((i, row, k), c, strict=True)):
                    new[c] += (a * numbers[0], 0.0, a * numbers[1])
    return new


def blended(points, uvw):
    """A point of a Bézier box."""
    total = np.zeros(3)
    for at in np.ndindex(*points.shape[:3]):
        weight = 1.0
        for axis in range(3):
            n, i, t = points.shape[axis] - 1, at[axis], uvw[axis]
            weight *= comb(n, i) * t**i * (1.0 - t) ** (n - i)
        total += weight * points[at]
    return total
