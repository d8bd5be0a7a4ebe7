"""Two nearest points of two segments, as near as rounding lets them be."""

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


@compiled
def nearest_places(
    a: FloatArray, b: FloatArray, p: FloatArray, q: FloatArray
) -> tuple[float, float]:
    """Where two segments a-b and p-q are nearest, as shares of each, 0 to 1; [-]."""
    uu = vv = uv = uw = vw = 0.0
    for c in range(3):
        u, v, w = b[c] - a[c], q[c] - p[c], a[c] - p[c]
        uu += u * u
        vv += v * v
        uv += u * v
        uw += u * w
        vw += v * w
    # The place s on a-b that is nearest to the line of the other, then the place t
    # nearest to that one, and s again where t had to be moved to an end.
    cross = uu * vv - uv * uv
    s = min(1.0, max(0.0, (uv * vw - vv * uw) / cross)) if cross > 0.0 else 0.0
    t = (uv * s + vw) / vv if vv > 0.0 else 0.0
    if not 0.0 < t < 1.0:
        t = min(1.0, max(0.0, t))
        s = min(1.0, max(0.0, (uv * t - uw) / uu)) if uu > 0.0 else 0.0
    return s, t


@compiled
def squared_gap(a: FloatArray, b: FloatArray, p: FloatArray, q: FloatArray) -> float:
    """Squared distance of two points, one of each segment a-b and p-q; [m^2].

    Whatever the rounding, the points are points of the segments; so it is never less
    than the squared distance of the segments by more than the rounding of the last
    lines.
    """
    s, t = nearest_places(a, b, p, q)
    square = 0.0
    for c in range(3):
        gap = a[c] + s * (b[c] - a[c]) - p[c] - t * (q[c] - p[c])
        square += gap * gap
    return square
