"""A closed chain of six hinges that moves although Grübler's count says it cannot (Bricard, IFToMM A04).

Five slender rods of 1 m and 1 kg between six hinges on the corners of a cube, each hinge at right angles to its
rods. Data: benchmark A04 of the IFToMM library of multibody problems (lim.ii.udc.es/mbsbenchmark).
"""

from ncgen import Model

CORNERS = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
AXES = [Y, Z, X, Y, Z, X]


def build() -> Model:
    m = Model("bricard")
    on_ground = (0, 5)
    points = [m.point(f"P{i + 1}", corner, fixed=i in on_ground) for i, corner in enumerate(CORNERS)]
    axes = [m.vector(f"u{i + 1}", axis, fixed=i in on_ground) for i, axis in enumerate(AXES)]
    for i in range(5):
        along = points[i + 1].initial - points[i].initial
        m.body(f"rod{i + 1}", points[i : i + 2], axes[i : i + 2], mass=1.0, inertia=(1 - along**2) / 12)
    m.gravity((0, -9.81, 0))
    m.line(*points)
    for point, axis in zip(points, axes):
        m.arrow(point, axis)
    m.simulation(duration=10.0)
    return m
