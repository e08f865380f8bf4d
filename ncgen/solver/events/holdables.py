"""What a mechanism may hold: gaps that are closed, joints and contacts that stick, ratchets and locks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ncgen.mechanism.active_in_c import Kind
from ncgen.model import Model
from ncgen.model.contacts import Contact
from ncgen.model.events import Lock
from ncgen.model.frictions import Friction
from ncgen.model.one_sided import Ratchet
from ncgen.model.values import Scalar, symbol_of

GAP, JOINT, RATCHET, LOCK = "NCGEN_HOLDS_GAP", "NCGEN_HOLDS_JOINT", "NCGEN_HOLDS_RATCHET", "NCGEN_HOLDS_LOCK"
RUBBING_GAP, CONTACT = "NCGEN_HOLDS_RUBBING_GAP", "NCGEN_HOLDS_CONTACT"
"""Kinds of what is held, in C."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Holdable:
    """What may be held. number: of its condition, −1 of a lock; rows: expressions that stay zero; switch: its parameter in exports

    held: name of the parameter that says where it is held, "" of gaps and contacts; position, initial: where it is, now and in the initial
    position; slip: name of the input that says in which direction it slips, "" of all but joints; static: friction that holds it, times the
    load of the constraints `pressed` where there are some; contact: whose gap it is, or that sticks
    """

    kind: Kind
    name: str
    number: int
    rows: tuple[Scalar, ...]
    switch: str
    held: str = ""
    position: Scalar = 0.0
    initial: Scalar = 0.0
    slip: str = ""
    static: Scalar | None = None
    pressed: tuple[int, ...] = ()
    contact: Contact | None = None

    @property
    def sticks(self) -> bool:
        """Whether it is a contact that sticks, whose rows are velocities."""
        return self.kind == CONTACT

    @property
    def key(self) -> tuple[str, bool]:
        """What tells it from others of a mechanism."""
        return self.name, self.sticks

    @property
    def words(self) -> str:
        """What it is called where a contact has two names, one for its gap."""
        return friction_of(self.contact) if self.contact and self.sticks else self.name

    @property
    def loads(self) -> tuple[str, ...]:
        """What the conditions of its load are called; of a contact that sticks its force stands behind them."""
        if self.sticks:
            marks = [""] if len(self.rows) == 1 else [f" {k}" for k in range(1, len(self.rows) + 1)]
            return (self.words, *(f"{self.words} force{mark}" for mark in marks))
        return () if self.kind == LOCK else (f"{self.name} down", f"{self.name} up") if self.kind == JOINT else (self.name,)

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters and inputs that say whether and where it is held, and how it slips."""
        slip = self.contact.slip if self.contact and self.sticks else (self.slip,)
        return tuple(name for name in (self.switch, self.held, *slip) if name)


def friction_of(contact: Contact) -> str:
    """What the friction of a contact is called where its gap has a name of its own."""
    return f"{contact.name}.friction"


def holdables(model: Model) -> Iterator[Holdable]:
    """What a mechanism may hold, gaps first and locks last; conditions are numbered in the order events, frictions, contacts, ratchets."""
    first, closing = len(model.events), {event.name for event in model.events.values() if event.impact and event.impact.rest == "hold"}
    for k, event in enumerate(model.events.values()):
        if event.name in closing:
            contact = model.contacts.get(event.name)
            kind = RUBBING_GAP if contact else GAP
            yield Holdable(kind=kind, name=event.name, number=k, rows=(event.when,), switch=f"{event.name}.on", contact=contact)
    for k, friction in enumerate(model.frictions.values(), first):
        yield _where_it_is(JOINT, k, friction, slip=friction.slip, static=friction.static, pressed=friction.pressed)
    for k, contact in enumerate(model.contacts.values(), first := first + len(model.frictions)):
        if contact.name in closing:
            switch = f"{contact.name}.sticks"
            yield Holdable(kind=CONTACT, name=contact.name, number=k, rows=contact.sliding, switch=switch, contact=contact)
    for k, ratchet in enumerate(model.ratchets.values(), first + len(model.contacts)):
        yield _where_it_is(RATCHET, k, ratchet)
    for lock in model.locks.values():
        yield _where_it_is(LOCK, -1, lock)


def _where_it_is(
    kind: Kind, number: int, of: Friction | Ratchet | Lock, *, slip: str = "", static: Scalar | None = None, pressed: tuple[int, ...] = ()
) -> Holdable:
    return Holdable(
        kind=kind, name=of.name, number=number, rows=(of.along.position - symbol_of(of.held),), switch=f"{of.name}.on", held=of.held,
        position=of.along.position, initial=of.along.initial, slip=slip, static=static, pressed=pressed,
    )  # fmt: skip
