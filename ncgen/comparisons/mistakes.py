"""Finding mistakes in hand-written Φ, Φ_q and γ: which row and column, and what is wrong there.

Every number is compared with the generated one at several random positions, so that nothing agrees by chance. For what
disagrees, explanations are tried one after the other, the simplest first; one that holds at all positions is reported.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import sympy

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.pieces import Pieces
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES

POSITIONS = 7
TOLERANCE = 1e-8
"""Relative to the largest number of the row: hand-written code may round, or be a finite difference, a little."""

NAMES = re.compile(r"(?:\w+_)?(phi_q|phi|gamma)$")
"""What functions of a file are called: phi, phi_q, gamma, with a word in front where there are several."""

State = tuple[np.ndarray, np.ndarray]
"""A position and velocities, (n,) each."""


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """function: of the file; row (from 1), label and equation; columns: coordinates, none for Φ and γ; kind, in a word; words"""

    function: str
    row: int
    label: str
    equation: str
    columns: tuple[str, ...]
    kind: str
    words: str

    def __str__(self) -> str:
        where = f", column{'s' * (len(self.columns) > 1)} {', '.join(self.columns)}" if self.columns else ""
        return f"{self.function}, row {self.row} ({self.label}){where}: {self.words}; the row is {self.equation}"


def find_mistakes(kernels: Kernels, path: str | Path) -> dict[str, list[Mistake]]:
    """{function: mistakes} of a Python file whose functions are called phi(q), phi_q(q), gamma(q, qd), or something_phi(q) and so on.

    They take free coordinates in the kernels' order and give arrays (m,) or (m, n). The file is run to get at them.
    Raises ModelError for a file without such functions, or a function that fails or gives another shape.
    """
    functions = _functions(Path(path))
    positions = list(_positions(kernels))
    return {name: _of_function(kernels, name, function, positions) for name, function in functions.items()}


def _functions(path: Path) -> dict[str, Callable[..., Any]]:
    if not path.is_file():
        raise ModelError(f"{path}: there is no such file; give a Python file with functions phi, phi_q or gamma")
    spec = importlib.util.spec_from_file_location("handwritten_by_the_user", path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{path}: Python cannot load it as a module; give a file that ends in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the user's own code: whatever it raises is said in a line
        raise ModelError(f"{path}: it cannot be run: {type(error).__name__}: {error}") from error
    functions = {name: f for name, f in vars(module).items() if callable(f) and NAMES.fullmatch(name)}
    if not functions:
        raise ModelError(f"{path}: it has no function called phi, phi_q or gamma (or something_phi and so on)")
    return functions


def _positions(kernels: Kernels) -> Iterator[State]:
    random = np.random.default_rng(5)
    for _ in range(POSITIONS):
        q = kernels.q0 + 0.3 * kernels.column_sizes * random.standard_normal(kernels.n)
        yield q, kernels.column_sizes * random.standard_normal(kernels.n)


def _of_function(kernels: Kernels, name: str, function: Callable[..., Any], positions: list[State]) -> list[Mistake]:
    words = NAMES.fullmatch(name)
    kernel = words[1] if words else name
    right = {"phi": kernels.phi, "phi_q": kernels.jacobian, "gamma": kernels.gamma}[kernel]
    arguments = [(q, qd) if kernel == "gamma" else (q,) for q, qd in positions]
    good = np.array([right(*a) for a in arguments])
    computed = np.array([_called(name, function, a, good.shape[1:]) for a in arguments])
    case = _Case(kernels, name, kernel, positions, computed.reshape(POSITIONS, kernels.m, -1), good.reshape(POSITIONS, kernels.m, -1))
    return [mistake for row in range(kernels.m) for mistake in case.of_row(row)]


def _called(name: str, function: Callable[..., Any], arguments: Sequence[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    try:
        value = np.asarray(function(*(a.copy() for a in arguments)), dtype=float)
    except Exception as error:  # the user's own code
        raise ModelError(f"{name}: it fails: {type(error).__name__}: {error}") from error
    if value.shape != shape:
        raise ModelError(f"{name}: it gives an array of shape {value.shape}, the model has {shape}, free coordinates in its own order")
    return value


class _Case:
    """One function: what it found and what is good, (positions, rows, columns)."""

    def __init__(self, kernels: Kernels, name: str, kernel: str, positions: list[State], computed: np.ndarray, good: np.ndarray) -> None:
        self.kernels, self.name, self.kernel, self.positions = kernels, name, kernel, positions
        self.computed, self.good = computed, good
        self.sizes = TOLERANCE * (np.max(np.abs(good), axis=(0, 2)) + 1e-300)
        self.wrong = ~np.all(np.abs(computed - good) <= self.sizes[None, :, None], axis=0)

    def same(self, row: int, one: np.ndarray, other: np.ndarray | float) -> bool:
        return bool(np.all(np.abs(one - other) <= self.sizes[row]))

    def of_row(self, row: int) -> list[Mistake]:
        columns: list[int] = np.flatnonzero(self.wrong[row]).tolist()
        if not columns:
            return []
        if whole := self._whole_row(row, columns):
            return [self._mistake(row, columns, *whole)]
        reasons: dict[tuple[str, str], list[int]] = {}
        for column in columns:
            reasons.setdefault(self._entry(row, column, columns), []).append(column)
        return [self._mistake(row, entries, *reason) for reason, entries in reasons.items()]

    def _whole_row(self, row: int, columns: list[int]) -> tuple[str, str] | None:
        """An explanation of all that is wrong in a row of several numbers."""
        computed, good = self.computed[:, row], self.good[:, row]
        if self.kernel != "phi_q" or len(columns) < 2:
            return None
        if np.all(self.wrong[row] == np.any(good != 0.0, axis=0)) and (factor := self._factor(row, computed, good)) is not None:
            return _scaled(factor, "the whole row")
        for other in range(self.kernels.m):
            if other != row and self.same(row, computed, self.good[:, other]):
                return "wrong row", f"it holds row {other + 1} ({self.kernels.rows[other].label})"
        return None

    def _entry(self, row: int, column: int, wrong: list[int]) -> tuple[str, str]:
        computed, good = self.computed[:, row, column], self.good[:, row, column]
        if self.kernel == "phi_q" and (moved := self._moved(row, column, wrong)):
            return moved
        if self.same(row, good, 0.0):
            return "extra entry", "there is a number where the derivative is zero"
        if self.same(row, computed, 0.0):
            return "missing entry", f"it is zero and should be {_shown(self._expression(row, column))}"
        factor = self._factor(row, computed, good)
        if factor is not None:
            return _scaled(factor, "it")
        return (
            self._term(row, column, computed - good)
            or self._exchanged(row, column, computed)
            or ("different", "it differs; no simple reason fits")
        )

    def _moved(self, row: int, column: int, wrong: list[int]) -> tuple[str, str] | None:
        """A number that belongs to another wrong column of the row, or to the same column of another row."""
        names, computed = self.kernels.coordinates, self.computed[:, row, column]
        if self.same(row, computed, 0.0):
            return None
        for other in wrong:
            if (
                other != column
                and self.same(row, computed, self.good[:, row, other])
                and not self.same(row, computed, self.good[:, row, column])
            ):
                back = self.same(row, self.computed[:, row, other], self.good[:, row, column])
                zero = self.same(row, self.good[:, row, column], 0.0)
                if back and not zero:
                    return "exchanged columns", f"columns {names[min(column, other)]} and {names[max(column, other)]} are exchanged"
                return "wrong column", f"it holds what belongs to column {names[other]}"
        return None

    def _factor(self, row: int, computed: np.ndarray, good: np.ndarray) -> float | None:
        """The number by which everything is multiplied, if it is one number."""
        is_sizeable = np.abs(good) > self.sizes[row]
        if not np.any(is_sizeable):
            return None
        factor = float(np.median(computed[is_sizeable] / good[is_sizeable]))
        return factor if abs(factor) > 1e-6 and self.same(row, computed, factor * good) else None

    def _term(self, row: int, column: int, difference: np.ndarray) -> tuple[str, str] | None:
        """A term of the sum, or all terms with a sine or cosine, that are missing, turned round, or multiplied."""
        terms = sympy.Add.make_args(sympy.expand(self._expression(row, column)))
        if len(terms) < 2:
            return None
        for term, label in _parts(terms):
            values = self._numbers(term)
            if self.same(row, difference, -values):
                return "missing term", f"{label} missing"
            if self.same(row, difference, -2 * values):
                return "sign of a term", f"{label} of the wrong sign"
            factor = self._factor(row, difference, values)
            if factor is not None and (times := _simple(1 + factor)):
                return "factor of a term", f"{label} multiplied by {times}"
        return None

    def _exchanged(self, row: int, column: int, computed: np.ndarray) -> tuple[str, str] | None:
        """Sine and cosine in each other's place."""
        expression = self._expression(row, column)
        other = expression.replace(
            lambda e: isinstance(e, (sympy.sin, sympy.cos)), lambda e: (sympy.cos if e.func is sympy.sin else sympy.sin)(*e.args)
        )
        if other != expression and self.same(row, computed, self._numbers(other)):
            return "sine and cosine", "sine and cosine are exchanged"
        return None

    def _expression(self, row: int, column: int) -> sympy.Expr:
        """What should stand there, in the names of the coordinates."""
        kernels, program = self.kernels, self.kernels.programs.programs[self.kernel]
        if not hasattr(self, "_values"):
            names = {"q": "", "qd": "d"}
            self.symbols = {a: [sympy.Symbol(mark + c.replace(".", "_")) for c in kernels.coordinates] for a, mark in names.items()}
            functions = {PIECES: _piecewise, **{name: getattr(sympy, f.sympy) for name, f in FUNCTIONS.items()}}
            values = {"t": sympy.Float(0), "p": [sympy.Float(float(x)) for x in kernels.p0], **self.symbols}
            self._values = evaluate(program, values, functions, sympy.Float)
        if self.kernel != "phi_q":
            return sympy.sympify(self._values[row])
        position = kernels.phi_q_pattern.positions().get((row, column))
        return sympy.sympify(self._values[position] if position is not None else 0)

    def _numbers(self, expression: sympy.Basic) -> np.ndarray:
        function = sympy.lambdify([*self.symbols["q"], *self.symbols["qd"]], expression)
        return np.array([function(*q, *qd) for q, qd in self.positions])

    def _mistake(self, row: int, columns: list[int], kind: str, words: str) -> Mistake:
        names = tuple(self.kernels.coordinates[c] for c in columns) if self.kernel == "phi_q" else ()
        equation = self.kernels.programs.equations.rows[row].equation
        return Mistake(
            function=self.name, row=row + 1, label=self.kernels.rows[row].label, equation=equation, columns=names, kind=kind, words=words
        )


def _piecewise(pieces: Pieces, x: sympy.Expr) -> sympy.Expr:
    """A lookup as sympy says it by itself."""
    if pieces.period:
        x = x - pieces.period * sympy.floor((x - pieces.knots[0]) / pieces.period)
    polynomials = [sympy.Add(*(c * (x - origin) ** k for k, c in enumerate(powers))) for origin, *powers in pieces.rows]
    return sympy.Piecewise(*((y, x < knot) for y, knot in zip(polynomials, pieces.knots, strict=False)), (polynomials[-1], True))


def _parts(terms: Sequence[sympy.Expr]) -> Iterator[tuple[sympy.Expr, str]]:
    """(part of a sum, what it is): every term, neighbours, and what has a sine or cosine in common."""
    for term in terms:
        yield term, f"the term {_shown(term)} is"
    for pair in zip(terms, terms[1:], strict=False):
        yield sympy.Add(*pair), f"the terms {_shown(sympy.Add(*pair))} are"
    for function in sorted(set().union(*(t.atoms(sympy.sin, sympy.cos) for t in terms)), key=str):
        yield sympy.Add(*(t for t in terms if t.has(function))), f"the part with {function} is"


def _scaled(factor: float, label: str) -> tuple[str, str]:
    if abs(factor + 1) < 1e-6:
        return "sign", f"{label} has the wrong sign"
    return "factor", f"{label} is multiplied by {_simple(factor) or f'{factor:.6g}'}"


def _simple(factor: float) -> str | None:
    """A small fraction in words, or None."""
    fraction = Fraction(factor).limit_denominator(12)
    return str(fraction) if fraction and abs(float(fraction) - factor) < 1e-6 and abs(fraction) <= 12 else None


def _shown(expression: sympy.Expr) -> str:
    """An expression with few digits, cut where it is long."""
    text = str(sympy.N(expression, 4))
    return text if len(text) <= 80 else text[:77] + "..."
