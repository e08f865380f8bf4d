"""N four-bar linkages in a row (IFToMM A02): one degree of freedom, but N + 1 where all rods lie flat.

Dimensions: the multibody benchmark's problem A02, 2N + 1 uniform rods of 1 m and 1 kg; the original has N = 40.
"""

from ncgen import Model


def build(N: int = 2) -> Model:
    m = Model("nfourbar")
    feet = [m.point(f"A{i}", (i, 0), fixed=True) for i in range(N + 1)]
    tops = [m.point(f"B{i}", (i, 1)) for i in range(N + 1)]
    standing = zip(feet, tops, strict=True)
    lying = zip(tops, tops[1:])
    for start, end in [*standing, *lying]:
        m.body(f"{start.name}{end.name}", points=[start, end], mass=1.0, inertia=1 / 12)
        m.line(start, end)
    m.independent(tops[0].x)
    m.gravity((0, -9.81, 0))
    m.range("B0.position.y", 0.5, 1.5)
    m.range("B1.position.y", 0.5, 1.5)
    m.range("gravity.y", -25, 0)
    m.simulation(duration=0.6, zd0={"B0.x": 1.0})
    return m
