"""What a loop on a long chain costs, written out: bars that hang in the plane between two points, run by hand for docs/performance.md.

python tests/program/hanging_bars.py
"""

import numpy as np

import ncgen
from ncgen.report.derivative import motion


def hanging(bars: int) -> ncgen.Model:
    """On half a circle, each of 1 kg."""
    m = ncgen.Model("hanging")
    m.gravity((0, -9.81, 0))
    angles = np.linspace(np.pi, 2 * np.pi, bars + 1)
    points = [m.point(f"P{i}", (np.cos(a), np.sin(a)), fixed=i in (0, bars)) for i, a in enumerate(angles)]
    for i in range(bars):
        m.body(f"bar{i}", points[i : i + 2], mass=1.0, inertia=0.01)
    return m


if __name__ == "__main__":
    print("bars  operations of a derivative")
    for bars in (4, 8, 16, 32):
        found = motion(ncgen.compile(hanging(bars)))
        print(f"{bars:4}  {found['derivative'] if found else 'by the matrix':>9}")
