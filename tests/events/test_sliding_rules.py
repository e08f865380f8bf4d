"""Rules of what slides, as C has them, against what they mean: parts by itertools, determinants by their limit, terms by NumPy, what
becomes of contacts by cases."""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
import pytest
from scipy.sparse import csr_array

from ncgen.mechanism.active_in_c import Active, is_missed
from ncgen.mechanism.sliding_in_c import SlidingContact, is_positive, parts, unseen_velocities
from ncgen.model.contacts import REST


@pytest.mark.parametrize("count", [0, 1, 2, 3, 6, 12, 13, 20])
def test_all_parts_are_looked_at_once_and_small_ones_first(count):
    """All 2ᵏ − 1 of up to twelve things, of more only the single ones and pairs."""
    sizes = range(1, (count if count <= 12 else 2) + 1)
    assert [*parts(count)] == [*chain.from_iterable(combinations(range(count), size) for size in sizes)]


def test_a_determinant_is_positive_above_rounding():
    assert is_positive(2e-9) and not is_positive(5e-10) and not is_positive(-1.0) and not is_positive(float("nan"))
    assert is_positive(2e-6, -1000.0) and not is_positive(5e-7, 1000.0)


def test_unseen_velocities_are_errors_of_steps():
    sizes, qd, qdd = np.array([1.0, 2.0]), np.array([-3.0, 0.0]), np.array([4.0, -5.0])
    assert unseen_velocities((1e-3, 1e-2), 9.0, sizes, qd, qdd) == pytest.approx([1e-2 + 3e-3, 2e-2], rel=1e-15)
    assert unseen_velocities((0.0, 0.0), 0.5, sizes, qd, qdd) == pytest.approx([0.1 * 0.5 * 4, 0.1 * 0.5 * 5], rel=1e-15)


def in_space(velocity=(0.0, 0.0), slip=(0.0, 0.0), size=9.0, unseen=0.0):
    """A contact whose velocities are the first two of three coordinates' times 1 and 2."""
    gradients = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    return SlidingContact(np.array(velocity), gradients, np.array(slip), np.full(3, size / 2), np.full(3, unseen / 2))


def test_a_slide_begins_with_a_direction_that_is_kept():
    """It comes to rest at REST times its length, which is what steps miss at least: 20 times what they do not see."""
    active = gap_and_contact((1, 0), (1, 1), (0, 0))
    active.released[1] = 1
    way, slip = np.array([3.0, -4.0]), np.zeros(2)
    least = active.turn(1, slip, in_space(unseen=1e-9), way, 0.0, 1.0)
    np.testing.assert_allclose(least, np.array([0.6, -0.8]) * 20e-9 / REST, rtol=1e-14)
    longer = active.turn(1, slip, in_space(), way, 0.8, 1.0)  # decelerated by 4 m/s² over its size of 9 m
    np.testing.assert_allclose(longer, np.array([0.6, -0.8]) * 100 * 6, rtol=1e-14)


def test_a_slide_goes_on_with_its_largest_velocity():
    """The one so far, or the present one, and at least a thousandth of its terms."""
    active, way = gap_and_contact((1, 0), (1, 0), (0, 0)), np.zeros(2)
    lengths = [
        np.linalg.norm(active.turn(1, np.zeros(2), in_space((0.0, own), (so_far, 0.0)), way, 0.0, terms / 9))
        for so_far, own, terms in ((3.0, 2.0, 1.0), (1.0, 2.0, 1.0), (1.0, 2.0, 5000.0))
    ]
    assert lengths == pytest.approx([3.0, 2.0, 5.0], rel=1e-14)


def test_a_slide_is_at_rest_below_what_steps_miss():
    assert in_space((0.0, 19e-9), unseen=1e-9).is_unseen and not in_space((0.0, 21e-9), unseen=1e-9).is_unseen
    assert in_space((0.0, 5e-9), size=6.0).is_still(1.0) and not in_space((0.0, 7e-9), size=6.0).is_still(1.0)
    assert in_space((0.0, 7e-9), (3.0, 0.0), size=6.0).is_still(1.0)


def test_how_far_a_change_goes_along_a_slide():
    assert in_space().along(np.array([3.0, -4.0]), np.array([2.0, 1.0, 100.0])) == 3 * 2 - 4 * 2


@pytest.mark.parametrize(("miss", "is_off"), [(0.0, False), (5e-10, False), (2e-9, True)])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_velocities_miss_constraints_by_a_share_of_their_terms(miss, is_off, speed):
    """Two coordinates that move together at 3 m/s and 1 rad/s; terms count velocities before as well as after."""
    sizes, qd, rows = np.array([1.0, 0.5]), np.array([3.0, 1.0]), np.array([[1.0, -3.0], [0.0, 2.0]])
    terms = np.abs(rows) @ np.maximum(qd, speed * sizes) + [0.0, 2.0]
    assert is_missed(csr_array(rows), np.array([0.0, 2.0 + miss * terms[1]]), sizes, speed, qd) is is_off
    assert is_missed(csr_array(rows), np.array([0.0, 2.0]), sizes, speed, qd + [miss * terms[0], 0.0]) is is_off


def test_what_had_no_velocity_before_may_have_one_of_rounding():
    """A driver sets the second coordinate in motion, and of the first row, whose terms cancel, rounding is left."""
    rows, qd = np.array([[0.1, -0.3]]), np.array([3.0, 1.0])
    assert (rows @ qd)[0] != 0.0
    assert not is_missed(csr_array(rows), np.zeros(1), np.ones(2), 0.0, qd)


def gap_and_contact(wanted, before, happened, kinds=("NCGEN_HOLDS_RUBBING_GAP", "NCGEN_HOLDS_CONTACT")):
    """A gap and the contact that needs it."""
    active = Active(kinds, (-1, 0))
    active.wanted[:], active.before[:], active.happened[:] = wanted, before, happened
    return active


@pytest.mark.parametrize(
    ("wanted", "before", "happened", "changes"),
    [
        ((1, 1), (1, 0), (0, 1), (None, 0)),  # it sticks
        ((1, 0), (1, 1), (0, 0), (None, 1)),  # it slips
        ((0, 0), (1, 1), (0, 0), (1, None)),  # it leaves, and no word of slipping
        ((1, 0), (1, 0), (0, 1), (None, 2)),  # it turns
        ((1, 0), (1, 0), (1, 0), (None, None)),  # a gap does not turn
    ],
)
def test_what_has_become_of_a_contact(wanted, before, happened, changes):
    active = gap_and_contact(wanted, before, happened)
    assert (active.change(0), active.change(1)) == changes


def test_how_a_contact_slides():
    """Not where it sticks or is open; as it was released; else as it moves, unless that is rounding."""
    slide = SlidingContact(np.array([-2.0]), np.ones((1, 1)), np.array([0.5]), np.ones(1), np.zeros(1))

    def turned(active, way):
        return active.turn(1, slide.slip, slide, np.array([way]), 0.0, 1.0)[0]

    assert turned(gap_and_contact((1, 1), (0, 0), (0, 0)), 3.0) == 0.0
    assert turned(gap_and_contact((0, 0), (0, 0), (0, 0)), 3.0) == 0.0
    active = gap_and_contact((1, 0), (1, 1), (0, 0))
    assert turned(active, 3.0) == -1.0
    active.released[1] = 1
    assert [turned(active, way) for way in (3.0, 0.0)] == [1.0, -1.0]
    active.released[1], active.still[1] = 0, 1
    assert turned(active, 0.0) == 0.5
