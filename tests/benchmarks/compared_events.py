"""Events in ncgen, MuJoCo, Drake, Exudyn and Siconos: `python tests/benchmarks/compared_events.py` prints a table of error against time.

Three scenes with closed forms:

- friction: 1 kg on a spring of 1 N/m with dry friction of 1 N, from 12 m with 6 m/s, which rests at 1 − (√205 − 14) m from 22.42 s on
  (Siconos' FrictionOscillator); its position after 100 s;
- ball: a ball that falls from 1 m and keeps half of its velocity; its height after 1 s, which is after two impacts;
- rolling: a ball of 0.1 m that slides with 5 m/s, μ = 0.2, and rolls after 2 v/(7 μ g); where it is after 2 s.

Each program has the settings that its documentation gives for such a scene; what is not installed is said. Seconds are those of the
processor for the motion alone, the least of three. MuJoCo, Drake and Exudyn are on PyPI; Siconos is a package of Debian (python3-siconos).
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import ncgen
from ncgen.exchange.examples import example_module

contacts, impacts, winch = (example_module(".", f"{name}.py") for name in ("contacts", "impacts", "winch"))

Found: TypeAlias = "tuple[int, float, float]"
"""Steps or evaluations, the position that is compared (m), and seconds."""

G, MU, SPEED = 9.81, 0.2, 5.0
DURATIONS = {"friction": 100.0, "ball": 1.0, "rolling": 2.0}


def expected() -> dict[str, float]:
    """Closed forms (m)."""
    fall = math.sqrt(2 / G)
    since, speed = DURATIONS["ball"] - 2 * fall, G * fall / 4  # since the second impact, and its velocity after it
    rolls = 2 * SPEED / (7 * MU * G)
    slid = SPEED * rolls - MU * G * rolls**2 / 2
    return {
        "friction": 1 - (math.sqrt(205) - 14),
        "ball": speed * since - G * since**2 / 2,
        "rolling": slid + 5 / 7 * SPEED * (DURATIONS["rolling"] - rolls),
    }


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and seconds of the processor."""
    begun = time.process_time()
    value = run()
    return value, time.process_time() - begun


# -- ncgen ---------------------------------------------------------------------------------------------------------------------------------


def slider() -> ncgen.Model:
    """The last scene, in space."""
    m = ncgen.Model("slider")
    n, O = m.vector("n", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True)
    body, C = contacts.sphere(m, (0.0, 0.0, 0.1))
    m.gravity((0, 0, -G))
    m.contact("floor", body, C, m.ground, O, radius=0.1, normal=n, friction=MU)
    return m


def in_ncgen() -> Iterator[tuple[str, str, Callable[[], Found]]]:
    """(scene, setting, run) of ncgen."""
    friction, speed = winch.oscillator()
    scenes = {
        "friction": (friction, "s", speed),
        "ball": (impacts.ball(), "P.y", None),
        "rolling": (slider(), "C.x", contacts.turning((SPEED, 0.0, 0.0), (0.0, 0.0, 0.0))),
    }
    for scene, (model, name, start) in scenes.items():
        kernels = ncgen.compile(model)

        def run(kernels: ncgen.Kernels, scene: str, name: str, start: dict[str, float] | None, rtol: float) -> Found:
            found, seconds = timed(lambda: ncgen.simulate(kernels, DURATIONS[scene], qd0=start, rtol=rtol, points=2))
            return found.statistics.evaluations, float(found[name][-1]), seconds

        for rtol in (1e-4, 1e-6, 1e-10):
            yield scene, f"rtol {rtol:g}", partial(run, kernels, scene, name, start, rtol)


# -- others --------------------------------------------------------------------------------------------------------------------------------


def in_mujoco() -> Iterator[tuple[str, str, Callable[[], Found]]]:
    """Its implicit integrator, one evaluation a step; restitution by the damping of the contact."""
    mujoco = import_module("mujoco")
    mass = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    joint = '<joint type="slide" axis="1 0 0" stiffness="1" frictionloss="1"{}/>'
    hard = ' solimpfriction="0.99 0.9999 0.001 0.5 2"'
    zeta = -math.log(0.5) / math.hypot(math.pi, math.log(0.5))  # the damping ratio at which half of the velocity is kept
    bouncing = f'solref="-1e6 {-2 * zeta * 1e3}" solimp="0.9999 0.9999 0.001"'
    floor = '<geom type="plane" size="99 99 1" condim="{}" friction="{} 0 0" {}/>'
    falling = '<body pos="0 0 1.1"><joint type="slide" axis="0 0 1" ref="1"/><geom type="sphere" size="0.1" mass="1" condim="1"/></body>'
    free = '<body pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.1" mass="1" condim="3" friction="0.2 0 0"/></body>'

    def run(scene: str, world: str, gravity: float, start: tuple[float, float] | None, step: float) -> Found:
        option = f'<option gravity="0 0 {-gravity}" integrator="implicitfast" cone="elliptic" timestep="{step!r}"/>'
        model = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{world}</worldbody></mujoco>")
        data, steps = mujoco.MjData(model), round(DURATIONS[scene] / step)
        if start:
            data.qpos[0], data.qvel[0] = start
        _, seconds = timed(lambda: mujoco.mj_step(model, data, steps))
        return steps, float(data.qpos[0]), seconds

    for step in (1e-2, 1e-3):
        for text in ("", hard):
            world = f"<body>{joint.format(text)}{mass}</body>"
            setting = f"{'hard ' if text else ''}frictionloss, step {step:g} s"
            yield "friction", setting, partial(run, "friction", world, 0.0, (12.0, 6.0), step)
        yield "rolling", f"step {step:g} s", partial(run, "rolling", floor.format(3, MU, "") + free, G, (0.0, SPEED), step)
    for step in (1e-4, 1e-5):
        world = floor.format(1, 0, bouncing) + falling.replace('condim="1"', f'condim="1" {bouncing}')
        yield "ball", f"damped contact, step {step:g} s", partial(run, "ball", world, G, None, step)


def in_exudyn() -> Iterator[tuple[str, str, Callable[[], Found]]]:
    """Its spring with friction proportional to the velocity below 1 mm/s, and its compliant limit stop; generalized-α."""
    exudyn, items = import_module("exudyn"), import_module("exudyn.itemInterface")

    def run(scene: str, start: tuple[float, float], weight: float, element: dict[str, float], step: float) -> Found:
        system = exudyn.SystemContainer().AddSystem()
        place, speed = start
        node = system.AddNode(items.Node1D(referenceCoordinates=[0], initialCoordinates=[place], initialVelocities=[speed]))
        system.AddObject(items.Mass1D(physicsMass=1.0, nodeNumber=node))
        ground = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0))
        moving = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
        system.AddLoad(items.LoadCoordinate(markerNumber=moving, load=-weight))
        data = system.AddNode(items.NodeGenericData(initialCoordinates=[0, 0, 0], numberOfDataCoordinates=3))
        system.AddObject(items.CoordinateSpringDamperExt(markerNumbers=[ground, moving], nodeNumber=data, **element))
        system.Assemble()
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(DURATIONS[scene] / step), DURATIONS[scene]
        settings.timeIntegration.verboseMode, settings.solutionSettings.writeSolutionToFile = 0, False
        _, seconds = timed(lambda: system.SolveDynamic(settings))
        place = system.GetNodeOutput(node, exudyn.OutputVariableType.Coordinates)
        return round(DURATIONS[scene] / step), float(place if isinstance(place, float) else place[0]), seconds

    rubbing = {"stiffness": 1.0, "fDynamicFriction": 1.0, "frictionProportionalZone": 1e-3}
    zeta = -math.log(0.5) / math.hypot(math.pi, math.log(0.5))
    stop = {"limitStopsLower": 0.0, "limitStopsUpper": 9.0, "limitStopsStiffness": 1e6, "limitStopsDamping": 2 * zeta * 1e3}
    for step in (1e-2, 1e-3):
        yield "friction", f"proportional zone, step {step:g} s", partial(run, "friction", (12.0, 6.0), 0.0, rubbing, step)
    for step in (1e-4, 1e-5):
        yield "ball", f"limit stop, step {step:g} s", partial(run, "ball", (1.0, 0.0), G, {"useLimitStops": True, **stop}, step)


def in_drake() -> Iterator[tuple[str, str, Callable[[], Found]]]:
    """Its SAP contact with a stiffness of 1e5 N/m; it has no restitution, so no bouncing ball."""
    drake = import_module("pydrake.all")

    def built(step: float, friction: float, gravity: float) -> tuple[Any, Any, Any]:
        builder = drake.DiagramBuilder()
        plant, _ = drake.AddMultibodyPlantSceneGraph(builder, step)
        plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector([0, 0, -gravity])
        surface = drake.ProximityProperties()
        drake.AddContactMaterial(None, 1e5, drake.CoulombFriction(friction, friction), surface)
        surface.AddProperty("material", "relaxation_time", 0.01)
        plant.RegisterCollisionGeometry(plant.world_body(), drake.RigidTransform(), drake.HalfSpace(), "floor", surface)
        body = plant.AddRigidBody("body", drake.SpatialInertia(1.0, [0, 0, 0], drake.UnitInertia.SolidSphere(0.1)))
        plant.RegisterCollisionGeometry(body, drake.RigidTransform(), drake.Sphere(0.1), "sphere", surface)
        return builder, plant, body

    def moved(builder: Any, plant: Any, begin: Callable[[Any], None], duration: float) -> tuple[Any, float]:
        plant.Finalize()
        simulator = drake.Simulator(builder.Build())
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        begin(context)
        simulator.Initialize()
        return context, timed(lambda: simulator.AdvanceTo(duration))[1]

    def rolling(step: float) -> Found:
        builder, plant, body = built(step, MU, G)

        def begin(context: Any) -> None:
            plant.SetFreeBodyPose(context, body, drake.RigidTransform([0, 0, 0.1 - G / 1e5]))
            plant.SetFreeBodySpatialVelocity(context=context, body=body, V_JpJc=drake.SpatialVelocity([0, 0, 0], [SPEED, 0, 0]))

        context, seconds = moved(builder, plant, begin, DURATIONS["rolling"])
        place = plant.EvalBodyPoseInWorld(context, body).translation()[0]
        return round(DURATIONS["rolling"] / step), float(place), seconds

    def rubbing(step: float) -> Found:
        builder, plant, body = built(step, 1.0, 1.0)
        carriage = plant.AddRigidBody("carriage", drake.SpatialInertia(1e-9, [0, 0, 0], drake.UnitInertia.SolidSphere(0.1)))
        along = plant.AddJoint(drake.PrismaticJoint("x", plant.world_frame(), carriage.body_frame(), [1, 0, 0]))
        up = plant.AddJoint(drake.PrismaticJoint("z", carriage.body_frame(), body.body_frame(), [0, 0, 1]))
        plant.AddForceElement(drake.PrismaticSpring(along, 0.0, 1.0))

        def begin(context: Any) -> None:
            along.set_translation(context, 12.0)
            along.set_translation_rate(context, 6.0)
            up.set_translation(context, 0.1 - 1e-5)

        context, seconds = moved(builder, plant, begin, DURATIONS["friction"])
        return round(DURATIONS["friction"] / step), float(along.get_translation(context)), seconds

    for step in (1e-2, 1e-3):
        yield "friction", f"SAP, step {step:g} s", partial(rubbing, step)
        yield "rolling", f"SAP, step {step:g} s", partial(rolling, step)


def in_siconos() -> Iterator[tuple[str, str, Callable[[], Found]]]:
    """In a process of the Python that has it: this one, or that of the system."""
    script = Path(__file__).parent / "peers" / "siconos_events.py"
    python = next((each for each in (sys.executable, shutil.which("python3", path="/usr/bin")) if each and _imports(each)), None)
    if python is None:
        raise ModuleNotFoundError("siconos")
    lines = subprocess.run([python, script], capture_output=True, text=True, check=True).stdout.splitlines()
    for scene, setting, *found in (json.loads(line) for line in lines if line.startswith("[")):
        yield scene, setting, partial(tuple, found)


def _imports(python: str) -> bool:
    return subprocess.run([python, "-c", "import siconos.kernel"], capture_output=True).returncode == 0


PROGRAMS = {"ncgen": in_ncgen, "MuJoCo": in_mujoco, "Drake": in_drake, "Exudyn": in_exudyn, "Siconos": in_siconos}


def main() -> None:
    """The table, scene by scene."""
    rows: list[tuple[str, str, str, Found]] = []
    for program, settings in PROGRAMS.items():
        try:
            for scene, setting, run in settings():
                tries = [run() for _ in range(3)]
                rows.append((scene, program, setting, min(tries, key=lambda found: found[2])))
        except ImportError as error:
            print(f"{program} is not installed: {error}", file=sys.stderr)
    values = expected()
    print("| scene | program | steps or evaluations | error (m) | time (ms) |\n|---|---|---:|---:|---:|")
    for scene, value in values.items():
        for _, program, setting, (count, place, seconds) in (row for row in rows if row[0] == scene):
            print(f"| {scene} | {program}, {setting} | {count:,} | {abs(place - value):.1e} | {1e3 * seconds:.2f} |")


if __name__ == "__main__":
    main()
