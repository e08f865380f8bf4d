"""Templates of the catalogue are read as the operations that sympy derives."""

from __future__ import annotations

import pickle
import subprocess
import sys

from ncgen.model.catalogue import ROW_TYPES
from ncgen.program.ir.catalogued import FILE, catalogue, catalogued, derived
from ncgen.program.ir.lower import LoweredTemplate, lowered
from ncgen.symbolic.templates import expression_row_template, symbols

WITHOUT_DERIVATIVES = """
import sys
import sympy

def refused(*arguments, **named):
    raise AssertionError("sympy differentiates")

sympy.Expr.diff = refused
import ncgen
ncgen.generate(ncgen.load(sys.argv[1])).c
"""


def test_the_file_is_what_sympy_derives():
    """Else: python -m ncgen.program.ir.catalogued"""
    assert FILE.read_text(encoding="utf-8") == derived()


def test_every_template_of_the_catalogue_is_there_and_taken():
    assert set(catalogued()) > set(ROW_TYPES)
    for template in catalogue():
        assert lowered(template).ops is catalogued()[template.key][0]
        assert list(lowered(template).outputs) == list(template.outputs)


def test_a_row_of_the_user_is_derived_whatever_it_is_called():
    (x,) = symbols(["x"])
    own = expression_row_template("distance", x**2, ("x",), ())
    assert lowered(own).ops == LoweredTemplate(own).ops != catalogued()["distance"][0]


def test_a_mechanism_of_the_catalogue_needs_no_derivative():
    for example in ("robot", "heavytop"):
        subprocess.run([sys.executable, "-c", WITHOUT_DERIVATIVES, example], check=True)


def test_templates_travel():
    """Also those that are derived when they are asked for."""
    for template in catalogue():
        assert dict(pickle.loads(pickle.dumps(template)).outputs) == dict(template.outputs), template.key


WITHOUT_SYMPY = """
import sys
import ncgen

model = ncgen.Model("pendulum")
origin, end = model.point("O", (0, 0), fixed=True), model.point("A", (1, 0))
model.body("rod", points=[origin, end], mass=1.0, inertia=0.1)
model.spring(end, model.point("B", (0, 2), fixed=True), stiffness=10.0, damping=0.1, free_length=1.0)
model.gravity((0, -9.81, 0))
ncgen.generate(model).c
assert "sympy" not in sys.modules, "sympy is imported"
"""


def test_numbers_need_no_sympy():
    subprocess.run([sys.executable, "-c", WITHOUT_SYMPY], check=True)
