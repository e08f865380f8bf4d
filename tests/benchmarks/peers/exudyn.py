"""Exudyn (https://exudyn.readthedocs.io): rods as rigid bodies in the plane, revolute joints, generalized-α."""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

exudyn = import_module("exudyn")
items = import_module("exudyn.itemInterface")

NAME = "Exudyn, generalized-α 0.9"


def _system(count: int) -> tuple[Any, Any, Any]:
    """Container, system and the first rod."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())

    def rod(middle: Sequence[float], angle: float, velocity: Sequence[float]) -> Any:
        node = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[*middle, angle], initialVelocities=velocity))
        body = system.AddObject(items.ObjectRigidBody2D(physicsMass=1.0, physicsInertia=1 / 12, nodeNumber=node))
        mass = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        system.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=[0, -9.81, 0]))
        return body

    def join(body: Any, place: Sequence[float], other: Any, there: Sequence[float]) -> None:
        markers = [
            system.AddMarker(items.MarkerBodyPosition(bodyNumber=b, localPosition=[*x, 0])) for b, x in ((body, place), (other, there))
        ]
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))

    standing = [rod((i, 0.5), np.pi / 2, [0.5, 0, -1.0]) for i in range(count + 1)]
    lying = [rod((i + 0.5, 1), 0.0, [1.0, 0, 0]) for i in range(count)]
    for i, body in enumerate(standing):
        join(ground, (i, 0), body, (-0.5, 0))
    for i, body in enumerate(lying):
        join(standing[i], (0.5, 0), body, (-0.5, 0))
        join(standing[i + 1], (0.5, 0), body, (0.5, 0))
    return container, system, standing[0]


def run(count: int, duration: float, intervals: int, steps: int) -> tuple[float, np.ndarray]:
    """(seconds, B0 (intervals + 1, 2)) of a run with `steps` steps in each of the intervals."""
    _container, system, first = _system(count)  # the system lives as long as its container
    kind = exudyn.OutputVariableType.Position
    top = items.SensorBody(bodyNumber=first, localPosition=[0.5, 0, 0], storeInternal=True, writeToFile=False, outputVariableType=kind)
    sensor = system.AddSensor(top)
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = intervals * steps
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = duration / intervals
    settings.linearSolverType = exudyn.LinearSolverType.EigenSparse if count > 5 else exudyn.LinearSolverType.EXUdense
    start = time.perf_counter()
    reached = system.SolveDynamic(settings)
    seconds = time.perf_counter() - start
    if not reached:
        raise RuntimeError("stopped before the end")
    return seconds, np.asarray(system.GetSensorStoredData(sensor))[:, 1:3]
