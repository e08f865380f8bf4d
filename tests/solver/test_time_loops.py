"""Whatever advances time asks for the next break, at which its steps have to end: in C, in lanes, in Python; exports move by the runtime.

Nothing is listed here but, for every language, the function that is asked and what it is to advance: loops are found in the sources.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import sympy

import ncgen
from ncgen.mechanism.break_times import break_times
from ncgen.methods.table import FORMALISMS, INTEGRATORS, goes_with

ROOT = Path(__file__).resolve().parents[2]
RUNTIME, TEMPLATES = ROOT / "ncgen" / "runtime", ROOT / "templates"


@dataclass(frozen=True)
class Language:
    """asked: what gives the next break; advance: what a state goes on by; begins: the first line of a function, with its name"""

    asked: str
    advance: str
    begins: str


C = Language(
    r"ncgen_next_break|ncgen_next_goal|next_breaks",
    r"\b(ncgen_accept\(r, (?!r->times\[0\])|ncgen_block_accept\(r, (?!r->running, r->start_t))",  # a run's begin is no advance
    r"^(?!typedef)[A-Za-z_][\w \*]*?\b(\w+)\([^;=]*$",
)


@dataclass(frozen=True)
class Function:
    file: str
    name: str
    text: str

    @cached_property
    def called(self) -> set[str]:
        """The names of what it calls."""
        return names_of_calls(self.text)

    @property
    def loops(self) -> Iterator[str]:
        """The text of every loop, with its head: up to the closing brace, or as far as lines are indented, or one statement."""
        lines = self.text.splitlines()
        for k, line in enumerate(lines):
            if re.match(r"\s*(\} )?(for|while|do)\b", line):
                indent = len(line) - len(line.lstrip())
                rest = [other for other in lines[k + 1 :] if other.strip()]
                inside = next((i for i, other in enumerate(rest) if len(other) - len(other.lstrip()) <= indent), len(rest))
                yield "\n".join([line, *rest[:inside]])


def names_of_calls(text: str) -> set[str]:
    return set(re.findall(r"(?<!\w)(#?\w+)\(", text))


def without_remarks(text: str) -> str:
    """Without comments and without what jinja does: both sides of its choices stay."""
    text = re.sub(r"\{#.*?#\}|\{%.*?%\}", "", text, flags=re.S)
    text = re.sub(r"\{\{ prefix \}\}", "X", text)
    text = re.sub(r"\{\{(.*?)\}\}", lambda m: " ".join(re.findall(r'"([^"]*)"', m[1])) or "0", text)
    return re.sub(r'/\*.*?\*/|(?m-s:^\s*//.*$)|""".*?"""', "", text, flags=re.S)


def functions(text: str, file: str, language: Language) -> list[Function]:
    """Those of a text; a function ends where the next line is not indented more than its first one, a brace apart."""
    lines = [line for line in without_remarks(text).splitlines() if line.strip()]
    found = []
    for k, line in enumerate(lines):
        if not (match := re.match(language.begins, line)):
            continue
        indent = len(line) - len(line.lstrip())
        ends = (i for i in range(k + 1, len(lines)) if len(lines[i]) - len(lines[i].lstrip()) <= indent and lines[i].strip() != "{")
        found.append(Function(file, match[1], "\n".join(lines[k : next(ends, len(lines))])))
    return found


def unasked(all_functions: list[Function], language: Language) -> list[str]:
    """Loops that advance time and never ask, by file and function.

    Those are right that ask, or call a loop that asks, or are called by what asks alone: it hands them the time at which they end.
    """
    bodies: dict[tuple[str, str], Function] = {}
    for f in all_functions:  # of one that a template has twice, with breaks and without, both are one
        key, (head, _, body) = (f.file, f.name), f.text.partition("\n")
        bodies[key] = Function(*key, "\n".join([*([bodies[key].text] if key in bodies else []), body or head.partition("{")[2]]))

    places: dict[str, list[Function]] = {}
    for f in bodies.values():
        places.setdefault(f.name, []).append(f)

    def called(names: set[str], file: str) -> list[Function]:
        """Functions of the same file, and of others those that it has none of."""
        return [f for name in names & places.keys() for f in ([bodies[file, name]] if (file, name) in bodies else places[name])]

    def asks(f: Function) -> bool:
        return re.search(rf"(?<!\w)({language.asked})\(", f.text) is not None

    def begins_to_ask(f: Function) -> bool:
        return asks(f) or any(asks(g) and (g.file, g.name) in advancing for g in called(f.called, f.file))

    advancing, grown = {k for k, f in bodies.items() if re.search(language.advance, f.text)}, True
    while grown:
        more = {k for k, f in bodies.items() if k not in advancing and any((g.file, g.name) in advancing for g in called(f.called, f.file))}
        grown = bool(more)
        advancing |= more

    def settled(f: Function, below: frozenset[str] = frozenset()) -> bool:
        """Whether time advances in it no farther than to what is asked for."""
        inner = [g for g in called(f.called, f.file) if (g.file, g.name) in advancing and g.name not in below and g != f]
        return begins_to_ask(f) or (
            not re.search(language.advance, f.text) and bool(inner) and all(settled(g, below | {f.name}) for g in inner)
        )

    def is_given_its_end(f: Function, above: frozenset[str] = frozenset()) -> bool:
        """Whether all that call it ask; one that hands it on to what asks, as a function, does."""
        callers = [g for g in bodies.values() if g != f and g.name not in above and f in called(g.called, g.file)]
        return bool(callers) and all(asks(g) or is_given_its_end(g, above | {f.name}) for g in callers)

    wrong = []
    for f in bodies.values():
        for loop in f.loops:
            inner = [g for g in called(names_of_calls(loop), f.file) if (g.file, g.name) in advancing]
            if re.search(language.advance, loop) or not all(map(settled, inner)):
                if not (begins_to_ask(f) or is_given_its_end(f)):
                    wrong.append(f"{f.file}: {f.name}")
                break
    return wrong


def of_files(paths: list[Path], language: Language) -> list[Function]:
    return [f for path in sorted(paths) for f in functions(path.read_text(), path.name, language)]


def with_loops(all_functions: list[Function]) -> set[str]:
    return {f.name for f in all_functions if any(True for _ in f.loops)}


def in_c() -> list[Function]:
    return of_files([*RUNTIME.rglob("*.c")], C)


def test_loops_in_c_ask():
    found = in_c()
    assert {"run_adaptive", "run_fixed", "step_through"} <= with_loops(found)
    assert unasked(found, C) == []


def test_exports_move_in_parts_where_laws_break():
    """Exports have no loop of their own: one call of the runtime goes on to the end of a step, from break to break where there are any."""
    chosen = re.compile(r"{% set advance = (.*?) if breaks else (.*?) %}")
    (ways,) = [match for path in (TEMPLATES / "package").rglob("*.jinja") for match in chosen.findall(path.read_text())]
    assert "ncgen_advance_over_breaks(" in ways[0] and "ncgen_advance(" in ways[1]
    for path in (TEMPLATES / "package").rglob("*.jinja"):
        assert not re.search(r"ncgen_advance(?!_through_events)\w*\(", chosen.sub("", path.read_text())), path.name


FORGETFUL = {
    "c": (
        C,
        """
int ncgen_forgetful(ncgen_run *r, ncgen_stepping *w)
{
    ncgen_scalar t = r->times[0];
    while (t < r->times[r->n_times - 1]) {
        const int status = ncgen_grid_step(r, w, t, t + r->options->max_step);
        if (status != NCGEN_OK)
            return status;
        t += r->options->max_step;
    }
    return NCGEN_OK;
}
""",
    ),
    "lanes": (
        C,
        """
static void run_forgetful(ncgen_block *r, ncgen_real t, ncgen_real h)
{
    for (int k = 0; k < 10; ++k)
        ncgen_block_accept(r, r->running, t + h, r->new_y, r->new_y);
}
""",
    ),
}


@pytest.mark.parametrize("name", FORGETFUL)
def test_a_loop_that_does_not_ask_is_found(name):
    language, text = FORGETFUL[name]
    assert unasked([*in_c(), *functions(text, "forgetful", language)], language) == ["forgetful: " + functions(text, "", language)[0].name]


def test_no_loop_in_c_may_forget():
    """Of every loop that asks by itself: without that it is found."""
    found = in_c()
    asking = [f for f in found if any(re.search(rf"(?<!\w)({C.asked})\(", loop) for loop in f.loops)]
    assert len(asking) >= 6
    for f in asking:
        forgetful = Function(f.file, f.name, re.sub(C.asked, "end_of", f.text))
        assert f"{f.file}: {f.name}" in unasked([forgetful if other is f else other for other in found], C)


# -- in Python: whatever calls a method's step is seen to end its steps at breaks ------------------------------------------------


def steps_in_sources() -> set[tuple[str, str]]:
    """(file, function) of calls of `step()` on a method, and of SciPy's own loops, in the package."""
    found = set()
    for path in (ROOT / "ncgen").rglob("*.py"):
        where = path.relative_to(ROOT / "ncgen")
        if where.parts[0] == "comparisons":  # other programs' motions
            continue
        for function in ast.walk(ast.parse(path.read_text())):
            if not isinstance(function, ast.FunctionDef):
                continue
            for node in ast.walk(function):
                name = getattr(node.func, "attr", getattr(node.func, "id", "")) if isinstance(node, ast.Call) else ""
                if (name == "step" and not node.args and not node.keywords) or name in ("solve_ivp", "odeint"):
                    found.add((str(where), function.name))
    return found


def pushed() -> ncgen.Model:
    """2 kg on a rod of 1 m, at rest, pushed by 1 N from 0.5 s to 0.6 s."""
    m = ncgen.Model("pushed")
    m.gravity((0, -9.81, 0))
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -1))
    m.body("mass", [A], mass=2.0)
    m.distance(O, A)
    m.force(A, (sympy.Heaviside(m.time - 0.5) - sympy.Heaviside(m.time - 0.6), 0, 0))
    return m


def test_every_method_in_python_ends_steps_at_breaks(monkeypatch):
    kernels = ncgen.compile(pushed(), "numpy")
    breaks = break_times(kernels, np.asarray(kernels.p0), 0.0, 1.0)
    assert len(breaks) == 2
    seen: set[tuple[str, str]] = set()
    passed: list[tuple[str, float, float]] = []
    method = ""

    def watched(original):
        def step(self):
            code, before = sys._getframe(1).f_code, self.t
            found = original(self)
            seen.add((str(Path(code.co_filename).relative_to(ROOT / "ncgen")), code.co_name))
            passed.extend((method, before, self.t) for first, last in breaks if before < first and self.t > last)
            return found

        return step

    monkeypatch.setattr(scipy.integrate.OdeSolver, "step", watched(scipy.integrate.OdeSolver.step))
    for formalism in (FORMALISMS[name] for name in ("coordinate-partitioning", "lagrange")):
        for integrator in INTEGRATORS.values():
            if (
                integrator.in_python
                and goes_with(formalism, integrator)
                and not (integrator.name.startswith("cvode") and not find_spec("sksundae"))
            ):
                method = f"{formalism.name}, {integrator.name}"
                fixed = {"max_step": 0.15} if integrator.has_fixed_step else {"rtol": 1e-3}
                ncgen.simulate(kernels, 0.7, formalism=formalism.name, integrator=integrator.name, engine="python", points=2, **fixed)
    assert passed == []
    assert seen == steps_in_sources()
