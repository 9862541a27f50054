"""Loads and points next to an edge, where sums cancel: against forty digits."""

import pytest

from benchmarks.exact import exact
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    IdealEdge,
    MomentDisc,
    PointForce,
    Scene,
    Strip,
    response,
)

WIDTH_M = 0.025
RTOLS = (1e-1, 1e-2, 1e-4, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("part", [1e-3, 1e-4])
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED], ids=["clamped", "supported"])
@pytest.mark.parametrize("kind", ["force", "disc that touches"])
def test_the_tolerance_holds_next_to_an_edge(kind: str, edge: IdealEdge, part: float) -> None:
    strip = Strip(width_m=WIDTH_M, thickness_m=0.0005, material=ALUMINIUM, edge=edge)
    y_m = part * WIDTH_M / 2
    load = (
        PointForce(x_m=0.0, y_m=y_m)
        if kind == "force"
        else MomentDisc(x_m=0.0, y_m=y_m, radius_m=y_m)
    )
    true_m = complex(exact(strip, load, 0.0, y_m, 700.0))
    scene = Scene(strip=strip, loads=(load,), points_m=((0.0, y_m),))
    for rtol in RTOLS:
        found_m = response(scene, [700.0], rtol).displacement_m[0, 0, 0]
        assert abs(found_m - true_m) < rtol * abs(true_m)
