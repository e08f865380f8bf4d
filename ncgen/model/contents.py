"""What a model holds: the parts of the builder share it, and everything else reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ncgen.model import arithmetic
from ncgen.model.elements import AXES, Point, Spatial

if TYPE_CHECKING:
    from ncgen.model.bodies import Body, BodyFrame
    from ncgen.model.contacts import Contact
    from ncgen.model.curves import Curve
    from ncgen.model.drawing import Drawing
    from ncgen.model.elements import Component, Element
    from ncgen.model.events import Event, Lock
    from ncgen.model.facts import Fact
    from ncgen.model.forces import BodyLoad, Callback, Force, Load, Potential, Rotor
    from ncgen.model.frictions import Friction
    from ncgen.model.one_sided import Ratchet
    from ncgen.model.outputs import Output
    from ncgen.model.polynomial_forces import ConstantForce
    from ncgen.model.rigid import Claims
    from ncgen.model.rows import Row
    from ncgen.model.value_conditions import Condition
    from ncgen.model.values import Input, Parameter, Scalar, Value


Box: TypeAlias = tuple[int, np.ndarray, np.ndarray]
"""How many elements are in it, and its lowest and highest corner (m)."""


class Contents:
    """What is known about a mechanism, by name or in the order in which it was given.

    elements, parameters, inputs, bodies: by name; ground: the body that does not move
    curves: splines and tables, by name
    outputs: by their labels
    rows: in the order of Φ
    gravity_field: three values
    branches: {angle: the run-time weights of its "paper" row}
    chosen_independent: names of coordinates
    conditions: on values that depend on parameters and stand in no body and no row of the catalogue by themselves, such as radii
    events: what happens where conditions are fulfilled on the way, by name
    frictions: dry friction that sticks, by name
    ratchets: what moves in one direction only, by name
    locks: constraints that events switch on and off, by name
    beginnings: {parameter or input: an expression of which it has the value at the start of a run}
    contacts: friction of rigid contacts, by the names of their events
    facts: how the model was told
    frames: of links, by their names in a robot's file
    limits: {coordinate: (lowest, highest) value of its joint in a robot's file, rad or m}
    left_out: what a robot's file says in addition, in words
    assembled: (joint, how far it was moved to close loops, rad or m), of a robot's file
    closing: makes a robot's model with one loop more; None of other models
    keeps_state: whether a call that is refused leaves no trace; not while a reader makes a model that it drops then
    starts: {name: arguments of `ncgen.simulate` (q0, qd0, t0)}, states that a robot's file names
    has_separate_numbers: whether numbers that are equal are merged in generated code no more than others, since each may be changed alone,
    as in a robot's file
    """

    name: str
    scale: bool
    form: str
    elements: dict[str, Element]
    parameters: dict[str, Parameter]
    inputs: dict[str, Input]
    curves: dict[str, Curve]
    outputs: dict[str, Output]
    bodies: dict[str, Body]
    ground: Body
    rows: list[Row]
    forces: list[Force | BodyLoad]
    potentials: list[Potential | ConstantForce]
    springs: list[Load]
    rotors: list[Rotor]
    callbacks: list[Callback]
    conditions: list[Condition]
    events: dict[str, Event]
    frictions: dict[str, Friction]
    ratchets: dict[str, Ratchet]
    locks: dict[str, Lock]
    beginnings: dict[str, Scalar]
    contacts: dict[str, Contact]
    gravity_field: tuple[Value, ...]
    branches: dict[str, tuple[Parameter, ...]]
    chosen_independent: tuple[str, ...]
    drawing: Drawing
    simulation_options: dict[str, object]
    facts: list[Fact]
    left_out: tuple[str, ...]
    assembled: tuple[tuple[str, float, str], ...]
    closing: Callable[..., Any] | None
    starts: Mapping[str, dict[str, Any]]
    has_separate_numbers: bool
    frames: dict[str, BodyFrame]
    limits: dict[str, tuple[float, float]]
    keeps_state: bool
    _related: Claims
    _box: Box | None
    _is_recording: bool

    @property
    def components(self) -> list[Component]:
        """All scalar coordinates in the order of q, free and fixed."""
        return [component for element in self.elements.values() for component in element.components]

    @property
    def numbers(self) -> dict[str, Parameter]:
        """What the kernels read from `p`, by name: parameters, then inputs."""
        return {**self.parameters, **self.inputs}

    def extent(self) -> float:
        """Return the diagonal of the box that holds all points so far, in the initial position.

        Returns
        -------
        float
            Length in m; 0 where all points are in one place.
        """
        count, low, high = self._box or (0, np.full(3, np.inf), np.full(3, -np.inf))
        for element in islice(reversed(self.elements.values()), len(self.elements) - count):
            if isinstance(element, Point):
                low, high = np.minimum(low, element.initial), np.maximum(high, element.initial)
        self._box = (len(self.elements), low, high)
        return arithmetic.norm(high - low) if low[0] <= high[0] else 0.0

    def bearer(self, word: str) -> Element | Parameter | Component | Curve | None:
        """Return what has a name: an element, a parameter, an input, a curve, or a coordinate of an element.

        Parameters
        ----------
        word : str
            The name.

        Returns
        -------
        Element, Parameter, Component, Curve or None
            What has the name; None if nothing has.
        """
        bearer_of_word = self.elements.get(word) or self.parameters.get(word) or self.inputs.get(word) or self.curves.get(word)
        owner, _, axis = word.rpartition(".")
        if bearer_of_word is None and axis in tuple(AXES) and isinstance(self.elements.get(owner), Spatial):
            return getattr(self.elements[owner], axis)
        return bearer_of_word
