"""The point of a simplex nearest to the origin, for the distance iteration.

A simplex is the first m <= 4 rows of an array; the result is written as weights.
Nothing here has to be exact: it only proposes a plane and two witness points.
"""

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


@compiled
def _dot(w: FloatArray, i: int, j: int) -> float:
    return float(w[i, 0] * w[j, 0] + w[i, 1] * w[j, 1] + w[i, 2] * w[j, 2])


@compiled
def _det(w: FloatArray, i: int, j: int, k: int) -> float:
    """Six times the signed volume of the origin and three corners."""
    return float(
        w[i, 0] * (w[j, 1] * w[k, 2] - w[j, 2] * w[k, 1])
        - w[i, 1] * (w[j, 0] * w[k, 2] - w[j, 2] * w[k, 0])
        + w[i, 2] * (w[j, 0] * w[k, 1] - w[j, 1] * w[k, 0])
    )


@compiled
def on_segment(w: FloatArray, i: int, j: int) -> float:
    """Weight of corner j in the point of the segment nearest to the origin."""
    span = 0.0
    along = 0.0
    for c in range(3):
        d = w[j, c] - w[i, c]
        span += d * d
        along -= w[i, c] * d
    if along <= 0.0 or span <= 0.0:
        return 0.0
    return 1.0 if along >= span else along / span


@compiled(inline=False)
def on_triangle(
    w: FloatArray, i: int, j: int, k: int
) -> tuple[float, float, float, float]:
    """Weights of the corners and the squared distance, by Voronoi regions."""
    ii, jj, kk = _dot(w, i, i), _dot(w, j, j), _dot(w, k, k)
    ij, ik, jk = _dot(w, i, j), _dot(w, i, k), _dot(w, j, k)
    # Projections of the origin on the edges, seen from each corner.
    at_i_j, at_i_k = ii - ij, ii - ik
    at_j_j, at_j_k = ij - jj, ij - jk
    at_k_j, at_k_k = ik - jk, ik - kk
    a = b = c = 0.0
    side_k = at_i_j * at_j_k - at_j_j * at_i_k
    side_j = at_k_j * at_i_k - at_i_j * at_k_k
    side_i = at_j_j * at_k_k - at_k_j * at_j_k
    if at_i_j <= 0.0 and at_i_k <= 0.0:
        a = 1.0
    elif at_j_j >= 0.0 and at_j_k <= at_j_j:
        b = 1.0
    elif side_k <= 0.0 and at_i_j >= 0.0 and at_j_j <= 0.0:
        b = at_i_j / (at_i_j - at_j_j)
        a = 1.0 - b
    elif at_k_k >= 0.0 and at_k_j <= at_k_k:
        c = 1.0
    elif side_j <= 0.0 and at_i_k >= 0.0 and at_k_k <= 0.0:
        c = at_i_k / (at_i_k - at_k_k)
        a = 1.0 - c
    elif side_i <= 0.0 and at_j_k >= at_j_j and at_k_j >= at_k_k:
        c = (at_j_k - at_j_j) / ((at_j_k - at_j_j) + (at_k_j - at_k_k))
        b = 1.0 - c
    else:
        whole = side_i + side_j + side_k
        b, c = side_j / whole, side_k / whole
        a = 1.0 - b - c
    squared = 0.0
    for axis in range(3):
        x = a * w[i, axis] + b * w[j, axis] + c * w[k, axis]
        squared += x * x
    return a, b, c, squared


@compiled
def _inside(w: FloatArray, weights: FloatArray) -> bool:
    """Whether the origin lies in the tetrahedron; writes its weights if so."""
    v0, v1 = _det(w, 1, 2, 3), -_det(w, 0, 2, 3)
    v2, v3 = _det(w, 0, 1, 3), -_det(w, 0, 1, 2)
    low, high = min(v0, v1, v2, v3), max(v0, v1, v2, v3)
    if low < 0.0 < high or low == high:
        return False
    whole = v0 + v1 + v2 + v3
    if whole == 0.0:
        return False
    weights[0], weights[1] = v0 / whole, v1 / whole
    weights[2], weights[3] = v2 / whole, v3 / whole
    return True


@compiled(inline=False)
def nearest(w: FloatArray, m: int, weights: FloatArray) -> None:
    """Weights of the point nearest to the origin, written to `weights`.

    Args:
        w: Corners in the first m rows, shape (4, 3); [m].
        m: 1 to 4.
        weights: Result, shape (4,), not negative, sum 1; 0 beyond m.
    """
    weights[:] = 0.0
    if m == 1:
        weights[0] = 1.0
    elif m == 2:
        t = on_segment(w, 0, 1)
        weights[0], weights[1] = 1.0 - t, t
    elif m == 3:
        a, b, c, _ = on_triangle(w, 0, 1, 2)
        weights[0], weights[1], weights[2] = a, b, c
    elif not _inside(w, weights):
        best = -1.0
        for skip in range(4):
            i, j, k = (skip + 1) % 4, (skip + 2) % 4, (skip + 3) % 4
            a, b, c, squared = on_triangle(w, i, j, k)
            if best < 0.0 or squared < best:
                best = squared
                weights[:] = 0.0
                weights[i], weights[j], weights[k] = a, b, c
