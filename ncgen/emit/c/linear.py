"""A state space as a header in C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ncgen.emit.environment import render
from ncgen.emit.naming import labels, prefix_of


def linear_header(name: str, source: str, matrices: Mapping[str, np.ndarray], names: Mapping[str, Sequence[str]]) -> str:
    """The text of a header: matrices {A, B, C, D: (rows, columns)} as constants with every digit, and what their places are called.

    source: in words, what motions are near to; names: {state, input, output: names}
    """
    prefix = prefix_of(name)
    return render(
        "c/linear.h.jinja",
        prefix=prefix,
        upper=prefix.upper(),
        place=source,
        indices=[(kind, labels(each)) for kind, each in names.items()],
        matrices=[(letter, [[repr(float(x)) for x in row] for row in matrix]) for letter, matrix in matrices.items()],
    )
