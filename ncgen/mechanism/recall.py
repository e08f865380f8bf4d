"""Programs and C source of a model kept in the cache folder, so that a second start neither imports sympy nor derives anything.

The key is the whole model (ncgen.symbolic.traced_model) and all that makes code of it. What is kept is data, in JSON: reading it runs
nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np

from ncgen.emit.sources import Sources
from ncgen.mechanism.by_programs import ByPrograms
from ncgen.mechanism.generator_identity import generator_identity
from ncgen.model import Model
from ncgen.model.pieces import Pieces
from ncgen.model.traced_numbers import Trace, Traced
from ncgen.program.ir.blocks import Column, Loop, Pattern, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.program.programs import Programs, TangentPrograms
from ncgen.symbolic.numbering import DeferredTerms
from ncgen.symbolic.traced_model import Description, described
from ncgen.toolchain.cache_location import Json, keep, kept
from ncgen.toolchain.undisturbed import undisturbed

Files: TypeAlias = dict[str, str]
"""{file name: text}."""

Made = TypeVar("Made")
"""What JSON can say, with lists for tuples."""

KIND = "programs"
MAX_ENTRY_BYTES = 40_000_000
"""Bytes up to which an entry is kept: a scene of 2,200 bodies takes 36 million, and making it anew three times as long as reading it."""

PARTS = {kind.__name__: kind for kind in (Column, ArrayElement, Loop, Pattern, Pieces, Program, Slot, Store, Straight, TableStore)}
FIELDS = {name: kind._fields if issubclass(kind, tuple) else tuple(field.name for field in fields(kind)) for name, kind in PARTS.items()}
"""What programs are made of, besides operations."""

OPERATIONS, TRACED = "operations", "traced"
JSON_TYPES = (float, int, type(None))
"""What stands for an operation without arguments as JSON can say it."""

JSON_NUMBERS = (int, float)
"""What long lists are of, as they are."""


def key(model: Model, emission: str) -> str | None:
    """What the sources of a model are kept under; None for a model that cannot be told from others."""
    description = described(model)
    return description and key_of_described(description, emission)


def key_of_described(description: Description, emission: str) -> str:
    """The same of a model that has been described."""
    return digest_of(f"{generator_identity()}\n{emission}\n{description.identity()}")


key_of = ByPrograms(lambda programs: key(programs.equations.model, programs.emission))
"""What a mechanism is kept under; its model is described once for all that is asked for."""


def digest_of(words: str) -> str:
    """What something is kept under that these words tell from all else."""
    return hashlib.sha256(words.encode()).hexdigest()[:40]


def recall(model: Model, emission: str, key: str) -> Sources | None:
    """The sources of a model that was compiled before, or None."""
    entry = kept(KIND, key)
    if entry is None:
        return None
    with undisturbed():
        programs, phi_q, mass, omitted, files = _restored(entry)
    equations = DeferredTerms(model)  # it derives what it lacks of them when asked
    recalled = Programs(equations=equations, programs=programs, phi_q=phi_q, mass=mass, emission=emission, omitted=omitted)
    key_of.note(recalled, key)
    return Sources(recalled, {"c": files})


def remember(key: str, sources: Sources) -> None:
    """Keep the sources of a model."""
    programs = sources.programs
    key_of.note(programs, key)
    with undisturbed():
        keep(KIND, key, _plain((programs.programs, programs.phi_q, programs.mass, programs.omitted, sources.c)), MAX_ENTRY_BYTES)


def derived(programs: Programs, description: str, make: Callable[[], Made]) -> Made:
    """What is made for a mechanism in addition to its own files, such as other C files, from the cache or made now.

    description: what it is, in words that tell them from others of the same mechanism
    """
    programs_key = key_of(programs)
    with undisturbed():
        return make() if programs_key is None else shared(f"{programs_key}\n{description}", make)


def derived_tangents(programs: Programs, kind: str, make: Callable[[], TangentPrograms]) -> TangentPrograms:
    """Tangent programs of a mechanism, from the cache or made now; kind: as theirs."""
    programs_key = key_of(programs)
    with undisturbed():
        if programs_key is None:
            return make()
        named = digest_of(f"{programs_key}\n{kind}")
        entry = kept(KIND, named)
        if entry is not None:
            return TangentPrograms(kind, *_restored(entry))
        made = make()
        keep(KIND, named, _plain((made.programs, made.patterns)), MAX_ENTRY_BYTES)
    return made


def shared(description: str, make: Callable[[], Any]) -> Any:
    """What is the same for all mechanisms, likewise."""
    named = digest_of(f"{generator_identity('solver', 'mechanism')}\n{description}")
    made = kept(KIND, named)
    if made is None:
        made = make()
        keep(KIND, named, made, MAX_ENTRY_BYTES)
    return made


def plain(value: Any) -> Json:
    """Programs as JSON can say them, with traced numbers as the operations that give them."""
    return _plain(value, True)


def restored(data: Any, trace: Trace | None, values: Sequence[float]) -> Any:
    """What `plain` made, with these values of the operations of a trace, which they know of where it is given."""
    return _restored(data, values.__getitem__ if trace is None else lambda operation: Traced(values[operation], trace, operation))


def untraced(value: Any) -> Any:
    """Programs with plain numbers for traced ones."""
    return _restored(_plain(value))


def _plain(value: Any, is_traced: bool = False) -> Json:
    """Programs as JSON can say them: tuples as lists, operations as columns, all else by its name with its parts."""
    if isinstance(value, Traced):
        return {TRACED: value.operation} if is_traced else float(value)
    if isinstance(value, ArrayElement):
        return {"ArrayElement": list(value)}
    if is_dataclass(value):
        return {type(value).__name__: [_plain(getattr(value, field.name), is_traced) for field in fields(value)]}
    if isinstance(value, dict):
        return {"dict": [[_plain(name, is_traced), _plain(member, is_traced)] for name, member in value.items()]}
    if isinstance(value, (tuple, list)):
        return _columns(value, is_traced) if value and isinstance(value[0], Op) else [_plain(member, is_traced) for member in value]
    return value.item() if isinstance(value, np.generic) else value


def _columns(ops: Sequence[Op], is_traced: bool) -> Any:
    """Operations as JSON can say them: they are nearly all that programs have, and a column is read and written in a third of the time."""
    leaves = [op.leaf if op.leaf.__class__ in JSON_TYPES else _plain(op.leaf, is_traced) for op in ops]
    return {OPERATIONS: [[op.code for op in ops], [op.args for op in ops], leaves]}


def _operations(parts: list[Any], number: Callable[[int], float]) -> tuple[Op, ...]:
    """What `_columns` made plain."""
    codes, arguments, leaves = parts
    whole = [_restored(leaf, number) if leaf.__class__ is dict else leaf for leaf in leaves]
    return tuple(map(Op._make, zip(codes, map(tuple, arguments), whole, strict=True)))


def _restored(data: Any, number: Callable[[int], float] = float) -> Any:
    """What `_plain` made plain. number: gives a traced number by its operation."""
    if isinstance(data, list):
        return tuple([member if member.__class__ in JSON_NUMBERS else _restored(member, number) for member in data])
    if isinstance(data, dict):
        ((name, parts),) = data.items()
        if name == OPERATIONS:
            return _operations(parts, number)
        if name == TRACED:
            return number(parts)
        if name == "dict":
            return dict(_restored(parts, number))
        members = [_restored(member, number) for member in parts]
        return PARTS[name](**dict(zip(FIELDS[name], members, strict=True)))
    return data
