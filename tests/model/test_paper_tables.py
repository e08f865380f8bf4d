"""The paper's tables give the paper's robot: its sizes, names, order and initial angles."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.model.elements import Angle, Point, Vector

SECTION_33 = (-90.0, 0.0, 76.7007, 0.0, -150.0015, -90.0)
TABLE_5 = (90.0, 0.0, 76.7007, 0.0, -150.0015, 90.0)
"""Initial angles in degrees, with the senses of section 3.3 and with those that Table 5 prints."""


def degrees(model) -> list[float]:
    """Initial values of psi1 … psi6."""
    return [math.degrees(model.elements[f"psi{k}"].initial[0]) for k in range(1, 7)]


def test_sizes(robot_model):
    """45 coordinates, 36 of them free; 25 rigid-body rows and 6 angles; bodies 2 to 9."""
    assert len(robot_model.components) == 45
    assert sum(not c.fixed for c in robot_model.components) == 36
    assert len(robot_model.rows) == 31
    assert list(robot_model.bodies) == [f"body{k}" for k in range(2, 10)]
    assert Counter(type(e) for e in robot_model.elements.values()) == {Point: 8, Vector: 5, Angle: 6}


def test_order_of_coordinates(robot_model):
    """Points and vectors stand where column 4 of Table 1 puts them, the angles behind them."""
    names = [c.name for c in robot_model.components]
    positions = {
        "r1": 1,
        "r2": 4,
        "u1": 7,
        "u2": 10,
        "u3": 13,
        "r3": 16,
        "r4": 19,
        "r5": 22,
        "r6": 25,
        "r7": 28,
        "u4": 31,
        "r8": 34,
        "u5": 37,
    }
    for element, position in positions.items():
        assert names[position - 1 : position + 2] == [f"{element}.{axis}" for axis in "xyz"]
    assert names[39:] == [f"psi{k}" for k in range(1, 7)]
    assert [n for n, c in zip(names, robot_model.components) if c.fixed] == [f"{e}.{a}" for e in ("r1", "u1", "u2") for a in "xyz"]


def test_codes_of_rows(robot_model):
    """Codes are those of the tables, row by row; the sixth angle measures from vectors about a segment."""
    codes = Counter(row.code for row in robot_model.rows)
    assert codes == {1000: 10, 1001: 3, 1002: 11, 1003: 1, 1010: 2, 1012: 1, 1013: 2, 1014: 1}
    assert [row.code for row in robot_model.rows[-6:]] == [1012, 1014, 1010, 1013, 1010, 1013]


def test_every_row_has_its_owner(robot_model):
    """Rigid rows belong to the body whose elements they tie, angle rows to their coordinate."""
    assert [str(row.owner) for row in robot_model.rows[:8]] == ["body2"] * 8
    assert [row.owner.kind for row in robot_model.rows] == ["body"] * 25 + ["coordinate"] * 6
    for row in robot_model.rows[:25]:
        elements = {e for combination in row.arguments.values() for e in combination.elements}
        assert elements <= set(robot_model.bodies[row.owner.name].elements)


@pytest.mark.parametrize("table, expected", [("ANGLES", SECTION_33), ("PRINTED_ANGLES", TABLE_5)])
def test_initial_angles(robot_tables, table, expected):
    """ψ at the initial position, to the four decimals printed; psi1 and psi6 change sign with Table 5's senses."""
    assert degrees(robot_tables.build(getattr(robot_tables, table))) == pytest.approx(expected, abs=5e-5)


def test_a_negative_axis_turns_the_sense(robot_tables):
    """−3 measures about −u3: psi2 of section 3.3 does, and psi3 changes its sign when it does."""
    axes = [str(robot_tables.build(getattr(robot_tables, t)).elements["psi2"].axis) for t in ("ANGLES", "PRINTED_ANGLES")]
    assert axes == ["-u3", "u3"]
    psi3 = robot_tables.ANGLES[2]
    turned = robot_tables.build([*robot_tables.ANGLES[:2], [*psi3[:5], -psi3[5], *psi3[6:]], *robot_tables.ANGLES[3:]])
    assert degrees(turned)[2] == pytest.approx(-SECTION_33[2], abs=5e-5)


FORMS = {"smooth": {}, "raw": {"scale": False}, "paper": {"form": "paper"}, "cosine": {"form": "cosine"}}


@pytest.mark.parametrize("table, form", [*(("ANGLES", form) for form in FORMS), ("PRINTED_ANGLES", "smooth"), ("PRINTED_ANGLES", "paper")])
def test_rows_hold_at_the_initial_position(robot_tables, table, form):
    """Whatever the form of the rows, the tables' own position satisfies them to rounding."""
    kernels = ncgen.compile(robot_tables.build(getattr(robot_tables, table), **FORMS[form]), backend="numpy")
    assert (kernels.n, kernels.m) == (36, 31)
    assert np.max(np.abs(kernels.phi(kernels.q0))) < 1e-14


def test_the_paper_rows_are_singular_where_the_sine_turns(robot_tables):
    """For psi1 = −90° the sine row's derivative by psi1 vanishes; the paper's choice is the cosine row there."""
    derivative = {}
    for form in ("sine", "paper", "smooth"):
        kernels = ncgen.compile(robot_tables.build(form=form), backend="numpy")
        derivative[form] = kernels.jacobian(kernels.q0)[25, kernels.index["psi1"]]
    assert abs(derivative["sine"]) < 1e-15
    assert abs(derivative["paper"]) == pytest.approx(1.0)
    assert abs(derivative["smooth"]) == pytest.approx(1.0)


def test_tables_may_be_arrays(robot_tables, robot_model):
    """Tables of numpy numbers give the same sources, byte by byte, as tables of Python's."""
    constraints = np.array(robot_tables.RIGID + robot_tables.ANGLES, dtype=float)
    options = dict(fixed=robot_tables.FIXED, independent=range(1, 7), name="robot")
    model = Model.from_tables(robot_tables.P, robot_tables.U, constraints, inertia=robot_tables.INERTIA, **options)
    model.gravity(np.array([0, 0, -9.81]))
    assert ncgen.generate(model).files == ncgen.generate(robot_model).files


def test_drawing_is_table_7(robot_model):
    """Ten lines and nine arrows, between the points and vectors of the table."""
    lines = [f"{a.name}-{b.name}" for a, b in robot_model.drawing.lines]
    assert lines == ["r1-r2", "r2-r3", "r1-r3", "r2-r4", "r3-r5", "r4-r5", "r5-r6", "r6-r4", "r6-r7", "r7-r8"]
    arrows = [f"{point.name}:{vector.name}" for point, vector in robot_model.drawing.arrows]
    assert arrows == ["r1:u1", "r1:u2", "r2:u3", "r3:u3", "r4:u3", "r5:u3", "r6:u3", "r7:u4", "r8:u5"]


def test_independent_coordinates_are_the_angles(robot_model):
    """Six of them, in the order asked for."""
    assert robot_model.chosen_independent == tuple(f"psi{k}" for k in range(1, 7))


def test_both_routes_give_the_same_rows(robot_tables):
    """Two rows of the tables and the calls that say the same have equal types, data and equations."""
    tables = Model.from_tables(robot_tables.P, robot_tables.U, [robot_tables.RIGID[0], robot_tables.RIGID[7], robot_tables.ANGLES[2]])
    calls = Model("calls")
    for element in list(tables.elements.values()):
        if isinstance(element, (Point, Vector)):
            add = calls.point if isinstance(element, Point) else calls.vector
            add(element.name, element.initial)
    e = calls.elements
    calls.distance("r1", "r2")
    calls.vector_segment(e["u1"], e["r1"] - e["r2"])
    calls.angle("psi3", e["r4"] - e["r6"], e["r7"] - e["r6"], e["u3"])
    for one, other in zip(tables.rows, calls.rows, strict=True):
        assert (one.type, one.code, one.label, one.equation) == (other.type, other.code, other.label, other.equation)
        assert one.data == pytest.approx(other.data, rel=1e-15)
