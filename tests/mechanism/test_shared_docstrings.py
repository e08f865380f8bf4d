"""Parameters that methods share are described once, and every method shows them."""

from __future__ import annotations

import inspect

from ncgen.mechanism.shared_docstrings import shares


@shares(q="array_like\nPosition (m).", t="float\nTime (s).")
class Shape:
    def length(self, q, scale, t=0.0):
        """Compute a length.

        Parameters
        ----------
        scale : float
            A factor.

        Returns
        -------
        float
            Length (m).
        """

    def name(self, q):
        """Return a name.

        Parameters
        ----------
        q : str
            Another thing.
        """

    def kind(self):
        """Return the kind."""

    def _own(self, q):
        """Not public."""


@shares()
class Circle(Shape):
    def name(self, q): ...


def test_entries_stand_in_the_order_of_the_signature():
    assert inspect.getdoc(Shape.length) == (
        "Compute a length.\n\nParameters\n----------\nq : array_like\n    Position (m).\nscale : float\n    A factor.\n"
        "t : float, optional\n    Time (s).\n\nReturns\n-------\nfloat\n    Length (m)."
    )


def test_what_a_method_says_itself_holds():
    assert inspect.getdoc(Shape.name) == "Return a name.\n\nParameters\n----------\nq : str\n    Another thing."
    assert (inspect.getdoc(Shape.kind), inspect.getdoc(Shape._own)) == ("Return the kind.", "Not public.")


def test_an_override_without_a_docstring_has_that_of_the_method():
    assert Circle.name.__doc__ == Shape.name.__doc__
