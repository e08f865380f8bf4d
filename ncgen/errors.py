"""What can go wrong, in one line each.

Every message names the thing by the user's own name for it, gives the numbers, and says what to do.
The command line prints the message alone and leaves with `exit_code`.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable
from typing import Any

LONGEST_LINE = 300
"""Characters of a message: one line that can be read."""

MAX_ECHO = 60
"""Characters of a value that a message repeats."""


def shortened(text: str, limit: int = LONGEST_LINE) -> str:
    """A text in one line of at most `limit` characters: what is too long loses its middle, and nothing in it moves the cursor."""
    shown = text if len(text) <= limit else text[: limit - limit // 2] + text[-(limit // 2) :]  # nothing longer is looked at
    line = "".join(c if c.isprintable() else " " if c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in shown)
    if len(text) <= limit:
        return line
    return f"{line[: limit - limit // 2 - 1]}…{line[limit - limit // 2 :]}"


def shown(value: object) -> str:
    """Anything in a message: one line, and not more of it than helps."""
    return shortened(written(value), MAX_ECHO)


def written(value: object) -> str:
    """Anything in one line, whatever it is; of numbers of more than 60 digits how many these are."""
    if isinstance(value, int) and abs(value) >= 10**MAX_ECHO:
        return f"a number of {int(math.log10(abs(value))) + 1} digits"
    try:
        text = (str if hasattr(type(value), "free_symbols") else repr)(value)
    except (ValueError, RecursionError):  # numbers of more digits than Python writes, and what is too deep
        return f"a {type(value).__name__}"
    return " ".join(text.split())


def counted(count: int, one: str) -> str:
    """Return a number with its noun: `1 row`, `2 bodies`, `3 degrees of freedom`; one: the singular, whose plural is regular."""
    noun, of, rest = one.partition(" of ")
    many = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{count} {noun if count == 1 else many}{of}{rest}"


def warn(message: str) -> None:
    """Warn at the line of the user's code that called ncgen."""
    frame, depth = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("ncgen."):
        frame, depth = frame.f_back, depth + 1
    warnings.warn(message, stacklevel=depth)


class NcgenError(Exception):
    """Report that ncgen cannot do something, in one line; `exit_code` is that of the command line.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    """

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(shortened(str(message)))


class ModelError(NcgenError):
    """Report that the description of a mechanism, or an argument, is wrong.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    """


class UnknownName(ModelError):
    """Something is mentioned that there is not; `name` is what was looked for."""

    def __init__(self, message: str, name: str = "") -> None:
        super().__init__(message)
        self.name = name


class DomainError(ModelError):
    """Report that a term of a model is NaN or infinite, with its name and the time.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    """


class CompileError(NcgenError):
    """Report that a compiler did not accept the sources.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    log : str
        What the compiler printed.
    """

    exit_code = 3

    def __init__(self, message: str, log: str = "") -> None:
        super().__init__(message)
        self.log = log


class ConvergenceError(NcgenError):
    """Report that an iteration did not reach its tolerance.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    history : tuple of float
        Norms of the residual.
    positions : array, shape (K, n), optional
        Positions in m and rad that were found while a mechanism was moved; at the last one it stopped.
    """

    exit_code = 4

    def __init__(self, message: str, history: tuple[float, ...] = (), positions: Any = None) -> None:
        super().__init__(message)
        self.history = history
        self.positions = positions


class DeadCentreError(ConvergenceError):
    """Report that a mechanism cannot move beyond a dead centre, where the coordinate that drives it turns back.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    history : tuple of float
        Norms of the residual.
    positions : array, shape (K, n), optional
        Positions in m and rad that were found; at the last one the mechanism stopped.
    """


class SingularError(NcgenError):
    """Report that a position or a matrix is singular where it must be regular.

    Parameters
    ----------
    message : str
        What is wrong, where, the number, and what to do.
    """

    exit_code = 4


class Interrupted(KeyboardInterrupt):
    """Report that Ctrl-C interrupted a run; it is a KeyboardInterrupt.

    Parameters
    ----------
    run : Trajectory
        The motion up to there.
    """

    def __init__(self, run: Any) -> None:  # a Trajectory, which this module cannot know: it is above all others
        super().__init__(f"{run.name}: stopped at t = {run.t[-1]:.6g} s")
        self.run = run


# -- messages of several packages ------------------------------------------------------------------------------------------


def one_of(value: object, where: str, known: Iterable[str]) -> str:
    """Return a word that is known.

    Parameters
    ----------
    value : object
        What was given.
    where : str
        What it is, with its place, for the message: `integrator`.
    known : iterable of str
        The words that there are.

    Returns
    -------
    str
        The word.

    Raises
    ------
    ModelError
        For anything else, with all words.
    """
    words = tuple(known)
    if not isinstance(value, str) or value not in words:
        raise unknown_word(value, where, words)
    return value


def unknown_word(value: object, where: str, known: Iterable[str]) -> ModelError:
    """Return the error about a word that is not among those that are known."""
    return ModelError(f"{where} {shown(value)} is unknown; choose one of {', '.join(known)}")


def given_twice(function: str, former: str, today: str) -> ModelError:
    """Return the error about an argument that is given by its former name and by that of today."""
    return ModelError(f"{function}: {former} is the former name of {today}, and both are given; give {today}")


def foreign(where: str, element: str) -> ModelError:
    """Return the error about an element of another model."""
    return ModelError(f"{where}: {element} belongs to another model; use this model's own")
