"""The model: what a user says about a mechanism, one call a fact.

    m = Model("pendulum")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (1, 0))
    m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))

Lengths are metres, masses kilograms, angles radians. Nothing is computed here beyond what is needed to
refuse a mistake on the line that makes it.
"""

from __future__ import annotations

import copy
import pickle
import sys
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Unpack

from ncgen.errors import ModelError, counted, shown
from ncgen.model.bodies import Body
from ncgen.model.coordinates import check_form
from ncgen.model.drawing import Drawing
from ncgen.model.events import called_by
from ncgen.model.facts import fact
from ncgen.model.gears import Gears
from ncgen.model.locks import Locks
from ncgen.model.loop_closing import LoopClosing
from ncgen.model.names import check_word, normal
from ncgen.model.pictures import Pictures
from ncgen.model.rigid import Frame
from ncgen.model.rows import Owner

if TYPE_CHECKING:
    from ncgen.model.connections import ModelDriver, ModelJoint
    from ncgen.model.tables import Table, TableOptions

LONGEST_NAME = 100
"""Characters of a model's name, which becomes a file name."""


class Model(Gears, LoopClosing, Locks, Pictures):
    """Describe a mechanism in natural coordinates.

    Parameters
    ----------
    name : str
        Prefix of the generated code.
    scale : bool
        Whether every constraint is divided by its characteristic length, so that metres and millimetres converge alike; False gives the
        paper's constraints.
    form : str
        How relative angles are tied to points and vectors, see `angle`.
    """

    def __init__(self, name: str, *, scale: bool = True, form: str = "smooth") -> None:
        name = normal(name)
        check_word(name, "model")
        if name.lower().startswith("ncgen") or len(name) > LONGEST_NAME:
            raise ModelError(
                f"model name {shown(name)}: it becomes a file name; use at most {LONGEST_NAME} letters, not beginning with ncgen"
            )
        self.name = name
        self.scale = scale
        self.form = check_form(form)
        self.elements = {}
        self.parameters = {}
        self.inputs = {}
        self.curves = {}
        self.outputs = {}
        self.bodies = {}
        self.rows = []
        self.forces = []
        self.potentials = []
        self.springs = []
        self.rotors = []
        self.callbacks = []
        self.conditions = []
        self.events = {}
        self.frictions = {}
        self.ratchets = {}
        self.locks = {}
        self.beginnings = {}
        self.contacts = {}
        self.gravity_field = (0.0, 0.0, 0.0)
        self.branches = {}
        self.chosen_independent = ()
        self.drawing = Drawing()
        self.simulation_options = {}
        self.ground = Body(name="ground", rigid=False, frame=Frame(owner=Owner("body", "ground")))
        self._related = {}
        self._box = None
        self.frames = {}
        self.limits = {}
        self.facts = []
        self.left_out = ()
        self.assembled = ()
        self.closing = None
        self.starts = {}
        self.has_separate_numbers = False
        self.keeps_state = True
        self._is_recording = False

    def __repr__(self) -> str:
        parts = counted(len(self.components), "coordinate"), counted(len(self.rows), "constraint"), counted(len(self.bodies), "body")
        return f"<Model {self.name}: {', '.join(parts)}>"

    @property
    def joints(self) -> tuple[ModelJoint, ...]:
        """The joints: what bodies share, and constraints between them."""
        from ncgen.model.connections import joints_of

        return joints_of(self)

    @property
    def drivers(self) -> tuple[ModelDriver, ...]:
        """The drivers, in the order of their constraints."""
        from ncgen.model.connections import drivers_of

        return drivers_of(self)

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return import_module("ncgen.report.cards").of_model(self)

    def __getstate__(self) -> dict[str, object]:
        """What pickle takes along. Raises ModelError naming a callback that pickle cannot find again."""
        for function in (*self.callbacks, *called_by(self.events.values())):
            _check_travels(function, self.name)
        return vars(self)

    def __deepcopy__(self, memo: dict[int, object]) -> Model:
        """A model of its own in the same process, where callbacks can be shared whatever they are."""
        other = memo[id(self)] = object.__new__(type(self))
        vars(other).update(copy.deepcopy(vars(self), memo))
        return other

    @fact
    def simulation(self, **options: object) -> None:
        """Set what `ncgen run` does with this model by default.

        Parameters
        ----------
        **options : object
            Arguments of `ncgen.simulate` by name.
        """
        self.simulation_options = {normal(key): _with_names(value) for key, value in options.items()}

    @classmethod
    def from_tables(cls, P: Table, U: Table, CONSTR: Table, **options: Unpack[TableOptions]) -> Model:
        """Make a model from the paper's Tables 1-7 as printed.

        Parameters
        ----------
        P, U : array_like
            Points and unit vectors (Table 1): rows of x, y, z and the 1-based position in q. They become r1, r2 and so on, and u1, u2 and
            so on.
        CONSTR : array_like
            Constraints (Tables 2-5): rows of 12 entries with the codes 1000-1003 and 1010-1015. Angles become psi1, psi2 and so on.
        **options : TableOptions
            `inertia`: {body: {m, cog, IT, r, u}} (Table 6), optionally with all `points` and `vectors` of the body; `lines`, `uvect`: pairs
            of points, and of point and vector (Table 7); `fixed`: 1-based positions in q that do not move (section 5); `independent`:
            numbers of independent angles; `name`, `scale` and `form`: as of `Model`.

        Returns
        -------
        Model
            The model.

        Raises
        ------
        ModelError
            With the table, its row and the number that is wrong.
        """
        from ncgen.model.tables import from_tables

        return from_tables(cls, P, U, CONSTR, **options)


def _with_names(options: object) -> object:
    """Options in which coordinates are called as the model keeps their names."""
    if isinstance(options, dict):
        return {normal(key): _with_names(value) for key, value in options.items()}
    if type(options) is list:
        return [_with_names(each) for each in options]
    return tuple(map(_with_names, options)) if type(options) is tuple else normal(options)


def checked_model(model: object) -> Model:
    """The model itself. Raises ModelError for anything else, such as an example's name."""
    if isinstance(model, Model):
        return model
    raise ModelError(f"model: {shown(model)} given; give an ncgen.Model, such as ncgen.load makes")


BY_VALUE = ("cloudpickle", "dill")
"""Packages that can pickle any function."""


def _check_travels(function: Callable[..., object], model: str) -> None:
    """Refuse a function that pickle, which takes only names along, could not find on the other side."""
    if any(module.rpartition(".")[2] in BY_VALUE for module in sys.modules):
        return  # whether it can travel is theirs to say
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError):
        name = getattr(function, "__qualname__", repr(function))[:100]
        raise ModelError(f"{model}: callback {name} cannot go to another process: define it by a name of its own in a module") from None
