"""Mass, gravity, velocity-dependent forces and energy of every basis against clouds of point masses."""

from dataclasses import dataclass

import numpy as np
import pytest
from oracles.point_masses import Attached, Cloud, RigidMotion

import ncgen

GRAVITY = np.array([0.7, -1.3, -9.81])
EXACT = 1e-12


@dataclass(frozen=True)
class Basis:
    """points, vectors: in the initial position; fixed: what of the first point does not move."""

    points: tuple
    vectors: tuple = ()
    planar: bool = False
    fixed: object = False

    @property
    def elements(self):
        return np.array([(*e, 0.0)[:3] for e in self.points + self.vectors])


R = ((0.1, -0.2, 0.3), (0.9, 0.4, 0.2), (-0.3, 0.8, -0.5), (0.2, 0.1, 1.4))
U = ((0.0, 0.6, 0.8), (0.8, 0.0, -0.6), (-0.48, 0.6, 0.64))

BASES = {
    "1 point": Basis(R[:1]),
    "2 points": Basis(R[:2]),
    "planar": Basis(((0.1, -0.2), (0.9, 0.4)), planar=True),
    "planar above": Basis(((0.1, -0.2, 0.3), (0.9, 0.4, 0.3)), planar=True, fixed="z"),
    "2 points 1 vector": Basis(R[:2], U[:1]),
    "2 points 1 vector, held": Basis(R[:2], U[:1], fixed=True),
    "2 points 1 vector, guided": Basis(R[:2], U[1:2], fixed="xz"),
    "2 points 2 vectors": Basis(R[:2], U[:2]),
    "2 points 2 vectors, guided": Basis(R[:2], U[:2], fixed="y"),
    "3 points 1 vector": Basis(R[:3], U[:1]),
    "4 points": Basis(R),
    "4 points, held": Basis(R, fixed=True),
    "1 point 3 vectors": Basis(R[:1], U),
}


def cloud_of(basis: Basis, rng) -> Cloud:
    """A random body that the basis can carry."""
    e = basis.elements
    if len(e) == 1:
        return Cloud.at(rng, e[0])
    if len(e) == 2 and not basis.planar:
        return Cloud.on_line(rng, *e)
    return Cloud.random(rng)


def model_of(basis: Basis, cloud: Cloud, gravity=GRAVITY, mass=None):
    m = ncgen.Model("body")
    held = [basis.fixed] + ["z" if basis.planar and len(p) == 3 else False for p in basis.points[1:]]
    points = [m.point(f"r{i}", p, fixed=f) for i, (p, f) in enumerate(zip(basis.points, held, strict=True), 1)]
    vectors = [m.vector(f"u{i}", u) for i, u in enumerate(basis.vectors, 1)]
    parameter = m.parameter("mass", mass) if mass is not None else cloud.mass
    com = basis.elements[0] if len(basis.elements) == 1 else cloud.com
    inertia = np.zeros((3, 3)) if len(basis.elements) == 1 else cloud.inertia
    m.body("it", points=points, vectors=vectors, mass=parameter, com=com, inertia=inertia)
    m.gravity(gravity)
    return m


def close(computed, expected, size=None):
    """Equal to 1e-12 of the largest expected number, or of `size` where the sum cancels."""
    size = np.abs(expected).max() if size is None else size
    assert np.shape(computed) == np.shape(expected)
    assert np.abs(computed - expected).max() <= EXACT * size


class Case:
    """A body in kernels and as a cloud, and the way from elements (k, 3) to q."""

    def __init__(self, basis: Basis, backend: str, **options):
        self.basis = basis
        rng = np.random.default_rng(len(basis.elements) + len(basis.vectors))
        cloud = cloud_of(basis, rng)
        self.model = model_of(basis, cloud, **options)
        self.kernels = ncgen.compile(self.model, backend)
        self.attached = Attached(cloud, basis.elements, len(basis.points), basis.planar)
        self.free = np.array([not c.fixed for c in self.model.components])

    def coordinates(self, elements):
        return np.asarray(elements).ravel()[self.free]

    def rates(self, rates):
        """Element rates with nothing on fixed components."""
        return np.where(self.free.reshape(-1, 3), rates, 0.0)

    def anywhere(self, rng):
        """Elements that need not be rigid, fixed components in place, and rates."""
        shape = self.basis.elements.shape
        return self.basis.elements + self.rates(0.5 * rng.normal(size=shape)), self.rates(rng.normal(size=shape))


@pytest.fixture(scope="module", params=BASES, ids=lambda name: name.replace(" ", "-").replace(",", ""))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def case(name):
    return Case(BASES[name], "numpy")


def rigid_motion(case, rng):
    """A random rigid motion that leaves fixed components in place, and the elements and rates it gives."""
    count = len(case.basis.points)
    motion = RigidMotion.random(rng, case.basis.elements[0], case.free[:3], case.basis.planar)
    points, vectors = case.basis.elements[:count], case.basis.elements[count:]
    elements = np.vstack([motion.place(points), motion.turned(vectors)])
    return motion, elements, np.vstack([motion.velocity_of(points), motion.rate_of(vectors)])


def test_energy_of_rigid_motions(case):
    """½ Σ m v² over the points of the cloud, by the rigid motion itself: no interpolation is involved."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        motion, elements, rates = rigid_motion(case, rng)
        q, qd = case.coordinates(elements), case.coordinates(rates)
        cloud = case.attached.cloud
        expected = cloud.kinetic(motion.velocity_of(cloud.places))
        kinetic, potential, power = case.kernels.energy(q, qd)
        close(kinetic, expected)
        close(0.5 * qd @ case.kernels.mass_matrix(q) @ qd, expected)
        close(potential, -cloud.mass * GRAVITY @ motion.place(cloud.com), cloud.mass)
        assert power == 0.0


def test_mass_and_forces_anywhere(case):
    """M = Σ m CᵀC and Q = Σ m Cᵀ(g − drift) for elements that need not be rigid."""
    rng = np.random.default_rng(2)
    cloud = case.attached.cloud
    for _ in range(10):
        elements, rates = case.anywhere(rng)
        q, qd = case.coordinates(elements), case.coordinates(rates)
        mass = case.attached.mass_matrix(elements)[np.ix_(case.free, case.free)]
        close(case.kernels.mass_matrix(q), mass)
        force = case.attached.force(elements, rates, GRAVITY)[case.free]
        close(case.kernels.force(q, qd), force)
        kinetic, potential, _ = case.kernels.energy(q, qd)
        close(kinetic, case.attached.kinetic(elements, rates))
        size = cloud.masses @ np.abs(case.attached.place(elements)) @ np.abs(GRAVITY)
        close(potential, case.attached.potential(elements, GRAVITY), size)


def test_mass_is_symmetric_and_positive(case):
    rng = np.random.default_rng(3)
    for _ in range(5):
        mass = case.kernels.mass_matrix(case.coordinates(case.anywhere(rng)[0]))
        assert np.array_equal(mass, mass.T)
        values = np.linalg.eigvalsh(mass)
        assert values[0] >= -EXACT * values[-1] and values[-1] > 0


def test_gravity_is_the_gradient_of_the_potential(case):
    """Q = −dV/dq at rest, by complex steps of the energy kernel."""
    rng = np.random.default_rng(4)
    q = case.coordinates(case.anywhere(rng)[0])
    still, h = np.zeros_like(q), 1e-30
    gradient = case.kernels.energy(q + 1j * h * np.eye(len(q)), still)[:, 1].imag / h
    force = case.kernels.force(q, still)
    close(force, -gradient)


@pytest.mark.parametrize("variant", [name for name in BASES if name.startswith("2 points 1 vector")])
def test_velocity_force_is_lagrange(variant):
    """Q_in = −Ṁq̇ + ½ ∂(q̇ᵀMq̇)/∂q: both derivatives by complex steps of M, gravity off."""
    case = Case(BASES[variant], "numpy", gravity=(0, 0, 0))
    rng = np.random.default_rng(5)
    h = 1e-30
    for _ in range(5):
        q, qd = map(case.coordinates, case.anywhere(rng))
        rate = case.kernels.mass_matrix(q + 1j * h * qd).imag / h
        slopes = case.kernels.mass_matrix(q + 1j * h * np.eye(len(q))).imag / h
        expected = -rate @ qd + 0.5 * np.einsum("kij,i,j->k", slopes, qd, qd)
        assert np.abs(expected).max() > 0.1, "a body whose velocity-dependent force vanishes proves nothing"
        close(case.kernels.force(q, qd), expected)


def test_mass_as_a_parameter(name):
    """p against the body built with that number; and ½ m v_G² + ½ ω·I ω, since I stays what was given."""
    basis = BASES[name]
    case = Case(basis, "numpy", mass=3.0)
    for mass in (3.0, 11.5):
        p = np.array([mass])
        cloud = case.attached.cloud
        like = Cloud.like(mass, cloud.com, cloud.inertia)
        fixed = ncgen.compile(model_of(basis, like), "numpy")
        rng = np.random.default_rng(6)
        for _ in range(3):
            q, qd = map(case.coordinates, case.anywhere(rng))
            for kernel, arguments in (("mass_matrix", (q,)), ("force", (q, qd)), ("energy", (q, qd))):
                expected = getattr(fixed, kernel)(*arguments)
                computed = getattr(case.kernels, kernel)(*arguments, p=p)
                close(computed, expected)
        motion, elements, rates = rigid_motion(case, rng)
        centre, omega = motion.velocity_of(cloud.com), motion.omega
        inertia = motion.rotation @ cloud.inertia @ motion.rotation.T
        expected = 0.5 * mass * centre @ centre + 0.5 * omega @ inertia @ omega
        close(case.kernels.energy(case.coordinates(elements), case.coordinates(rates), p=p)[0], expected)


def test_gravity_as_a_parameter():
    """V and Q follow g in p; M does not."""
    basis = BASES["2 points 1 vector, held"]
    case = Case(basis, "numpy")
    m = ncgen.Model("body")
    g = m.parameter("g", 9.81)
    r1, r2 = m.point("r1", R[0], fixed=True), m.point("r2", R[1])
    u1 = m.vector("u1", U[0])
    cloud = case.attached.cloud
    m.body("it", points=[r1, r2], vectors=[u1], mass=cloud.mass, com=cloud.com, inertia=cloud.inertia)
    m.gravity((0.0, g * 0.5, -g))
    kernels = ncgen.compile(m, "numpy")
    rng = np.random.default_rng(7)
    for value in (9.81, 1.62):
        field, p = np.array([0.0, value * 0.5, -value]), np.array([value])
        elements, rates = case.anywhere(rng)
        q, qd = case.coordinates(elements), case.coordinates(rates)
        force = case.attached.force(elements, rates, field)[case.free]
        close(kernels.force(q, qd, p=p), force)
        kinetic, potential, _ = kernels.energy(q, qd, p=p)
        close(kinetic, case.attached.kinetic(elements, rates))
        close(potential, case.attached.potential(elements, field), cloud.mass)


# -- the robot: eight bodies on shared elements ------------------------------------------------------------


class RobotClouds:
    """The eight bodies of Table 6 and its completion as six point masses each."""

    def __init__(self, tables, model):
        self.model = model
        self.free = np.array([not c.fixed for c in model.components])
        self.places = {c.name: i for i, c in enumerate(model.components)}
        self.bodies = [self._body(entry) for entry in tables.INERTIA.values()]

    def _body(self, entry):
        names = [f"r{i}" for i in entry["r"]] + [f"u{i}" for i in entry.get("u", ())]
        initial = [self.model.elements[name].initial for name in names]
        cloud = Cloud.like(entry["m"], entry["cog"], np.asarray(entry["IT"]))
        columns = np.array([[self.places[f"{name}.{axis}"] for axis in "xyz"] for name in names])
        return Attached(cloud, initial, len(entry["r"])), columns

    def full(self, q, fixed):
        everything = np.array([c.initial if fixed else 0.0 for c in self.model.components])
        everything[self.free] = q
        return everything

    def sums(self, q, qd, gravity):
        """M, Q, kinetic and potential energy."""
        x, v = self.full(q, True), self.full(qd, False)
        mass, force, kinetic, potential = np.zeros((len(x), len(x))), np.zeros(len(x)), 0.0, 0.0
        for attached, columns in self.bodies:
            e, de = x[columns], v[columns]
            mass[np.ix_(columns.ravel(), columns.ravel())] += attached.mass_matrix(e)
            force[columns.ravel()] += attached.force(e, de, gravity)
            kinetic += attached.kinetic(e, de)
            potential += attached.potential(e, gravity)
        return mass[np.ix_(self.free, self.free)], force[self.free], kinetic, potential


def test_robot(robot, robot_numpy, robot_tables):
    clouds = RobotClouds(robot_tables, robot.model)
    rng = np.random.default_rng(8)
    for _ in range(20):
        q, qd = robot.q0 + 0.5 * rng.normal(size=robot.n), rng.normal(size=robot.n)
        mass, force, kinetic, potential = clouds.sums(q, qd, np.array([0, 0, -9.81]))
        for kernels in (robot, robot_numpy):
            close(kernels.mass_matrix(q), mass)
            close(kernels.force(q, qd), force)
            close(kernels.energy(q, qd), np.array([kinetic, potential, 0.0]))


def test_body_3_of_the_robot(robot_tables):
    """Table 6 alone: its mass, centre and inertia on r2, r4, u3, turning about the axis u3."""
    entry = robot_tables.INERTIA[3]
    m = ncgen.Model("body3")
    r2, r4 = (m.point(f"r{i}", robot_tables.P[i - 1, :3]) for i in (2, 4))
    u3 = m.vector("u3", robot_tables.U[2, :3])
    m.body("body3", points=[r2, r4], vectors=[u3], mass=entry["m"], com=entry["cog"], inertia=entry["IT"])
    kernels = ncgen.compile(m, "c")
    spin = 1.7
    arm = r4.initial - r2.initial
    q, qd = kernels.q0, np.concatenate([np.zeros(3), np.cross([spin, 0, 0], arm), np.zeros(3)])
    about_r2 = 27.263 + 250.0 * (1.2165 - 0.6683) ** 2  # Steiner, the centre of mass being above r2
    close(kernels.energy(q, qd)[0], 0.5 * about_r2 * spin**2)


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("emission", ["unrolled", "tabled"])
def test_bodies_in_both_backends(backend, emission):
    """Three bodies on shared elements: with and without loops, compiled and not."""
    rng = np.random.default_rng(9)
    m = ncgen.Model("chain")
    places = [(0.0, 0.0, 0.0), (1.0, 0.2, 0.1), (1.5, 1.0, 0.3), (1.4, 1.8, 0.9)]
    points = [m.point(f"r{i}", p) for i, p in enumerate(places, 1)]
    u = m.vector("u", (0.0, 0.6, 0.8))
    clouds = [Cloud.random(rng) for _ in range(3)]
    bodies = []
    for i, cloud in enumerate(clouds):
        pair = points[i : i + 2]
        m.body(f"link{i}", points=pair, vectors=[u], mass=cloud.mass, com=cloud.com, inertia=cloud.inertia)
        bodies.append((Attached(cloud, [e.initial for e in (*pair, u)], 2), [i, i + 1, 4]))
    m.gravity(GRAVITY)
    kernels = ncgen.compile(m, backend, emission)
    for _ in range(5):
        e, de = rng.normal(size=(2, 5, 3))
        mass, force = np.zeros((5, 3, 5, 3)), np.zeros((5, 3))
        for attached, chosen in bodies:
            mass[np.ix_(chosen, range(3), chosen, range(3))] += attached.mass_matrix(e[chosen]).reshape(3, 3, 3, 3)
            force[chosen] += attached.force(e[chosen], de[chosen], GRAVITY).reshape(3, 3)
        computed = kernels.mass_matrix(e.ravel())
        close(computed, mass.reshape(15, 15))
        close(kernels.force(e.ravel(), de.ravel()), force.ravel())


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3, 1e6, 1e8])
def test_inertia_of_a_body_of_any_size_on_a_segment_and_a_unit_vector(size):
    """The segment is as long as the body and the vector is not: M in units of the size is the same for all sizes."""
    rotation = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [-0.3, 1.0, 2.0], [0.7, -0.2, 1.0]]))[0]
    tensor = rotation @ np.diag([2.0, 3.0, 4.0]) @ rotation.T
    m = ncgen.Model("scaled")
    A, B = m.point("A", (0, 0, 0)), m.point("B", size * np.array([0.9, 0.5, -0.3]))
    u = m.vector("u", (0.6, 0.0, 0.8))
    m.body("b", [A, B], [u], mass=5.0, com=size * np.array([0.3, 0.1, 0.4]), inertia=size**2 * (tensor + tensor.T) / 2)
    k = ncgen.compile(m, "numpy")
    units = np.array([size] * 6 + [1.0] * 3)
    omega, v = np.array([0.3, -0.7, 0.2]), np.array([0.1, 0.2, -0.4])
    arms = np.array([[0, 0, 0], [0.9, 0.5, -0.3], [0.6, 0.0, 0.8]])
    rates = np.cross(omega, arms) + np.array([v, v, np.zeros(3)])
    centre = v + np.cross(omega, (0.3, 0.1, 0.4))
    qd = units * rates.ravel()
    assert qd @ k.mass_matrix(k.q0) @ qd / 2 == pytest.approx(size**2 * (5.0 * centre @ centre + omega @ tensor @ omega) / 2, rel=1e-12)


def test_mass_matrix_is_symmetric_to_the_last_bit():
    """Also where its entries are sums whose order could differ on the two sides of the diagonal."""
    rng = np.random.default_rng(4)
    for mass in (3.0, None):
        m = ncgen.Model("pairs")
        points = [m.point(name, rng.normal(size=3)) for name in "ABC"]
        m.body("b", points[:2], [m.vector("u", (0.6, 0.0, 0.8))], mass=mass or m.parameter("m", 3.0), inertia=(2.0, 3.0, 4.0))
        m.body("c", points, mass=2.0, inertia=(2.0, 2.5, 3.0))
        k = ncgen.compile(m, "numpy")
        for q in k.q0 + rng.normal(size=(20, k.n)):
            assert np.array_equal(k.mass_matrix(q), k.mass_matrix(q).T)
