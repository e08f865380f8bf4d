"""Andrews' squeezing mechanism (IFToMM A03): seven bodies, millimetres and milliseconds, one degree of freedom.

Dimensions, masses, spring and torque: the multibody benchmark's problem A03, the same as the Andrews squeezer of the
IVP test set, where beta0 = -0.0617138900142764.
"""

import numpy as np

from ncgen import Model

O, A, B, C = map(np.array, ((0, 0), (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)))


def build(beta0=-0.0620):
    F = 0.007 * direction(beta0)
    E = meet(F, 0.028, B, 0.035)
    G = meet(A, 0.040, E, 0.020)
    H = meet(E, 0.020, A, 0.040)
    D = local(B, E, (-0.020, 0.018))

    m = Model("andrews")
    O_, A_, B_, C_ = (m.point(name, place, fixed=True) for name, place in zip("OABC", (O, A, B, C), strict=True))
    F_, E_, D_, G_, H_ = (m.point(name, place) for name, place in zip("FEDGH", (F, E, D, G, H), strict=True))
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    m.body("K1", [O_, F_], mass=0.04325, com=local(O, F, (0.00092, 0)), inertia=2.194e-6)
    m.body("K2", [F_, E_], mass=0.00365, com=local(F, E, (0.0115, 0)), inertia=4.410e-7)
    m.body("K3", [B_, E_, D_], mass=0.02373, com=local(B, E, (0.01874, 0.01043)), inertia=5.255e-6)
    m.body("K4", [E_, G_], mass=0.00706, com=local(E, G, (0.01421, 0)), inertia=5.667e-7)
    m.body("K5", [A_, G_], mass=0.07050, com=local(A, G, (0.02308, 0.00916)), inertia=1.169e-5)
    m.body("K6", [E_, H_], mass=0.00706, com=local(E, H, (0.01421, 0)), inertia=5.667e-7)
    m.body("K7", [A_, H_], mass=0.05498, com=local(A, H, (0.01228, -0.00449)), inertia=1.912e-5)
    m.spring(C_, D_, stiffness=4530.0, free_length=0.07785)
    beta = m.angle("beta", start=x, end=F_ - O_, axis=z)
    m.torque(beta, 0.033)
    m.independent(beta)
    m.line(O_, F_, E_, B_, D_, E_, G_, A_, H_, E_)
    m.line(C_, D_)
    m.simulation(duration=0.03, integrator="dop853")
    return m


def direction(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def local(start, end, place):
    """A place in the frame at `start` whose x axis points to `end`."""
    along = (end - start) / np.linalg.norm(end - start)
    return start + place[0] * along + place[1] * np.array([-along[1], along[0]])


def meet(P, p, Q, q):
    """The point at distance p from P and q from Q, on the left of the line from P to Q."""
    d = np.linalg.norm(Q - P)
    along = (p**2 - q**2 + d**2) / (2 * d)
    return local(P, Q, (along, np.sqrt(p**2 - along**2)))
