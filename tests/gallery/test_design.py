"""The example scripts that design and identify find what is true, with derivatives that are exact."""

from __future__ import annotations

import sys

import numpy as np

from ncgen.exchange.examples import example_module


def coupler_point(lengths, angle):
    """By the intersection of circles, in real pairs so that lengths may be complex: (x, y)."""
    crank, coupler, rocker, ground, near, far = lengths

    def meeting(a, b, r, s):
        way = b - a
        square = way @ way
        along = (r**2 - s**2 + square) / (2 * square)
        across = np.sqrt(r**2 / square - along**2)
        return a + along * way + across * np.array([-way[1], way[0]])

    B = crank * np.array([np.cos(angle), np.sin(angle)])
    C = meeting(B, np.array([ground, 0.0]), coupler, rocker)
    return meeting(B, C, near, far)


def misses(synthesis, lengths):
    return np.concatenate(
        [coupler_point(lengths, angle) - target for angle, target in zip(synthesis.ANGLES, synthesis.TARGETS, strict=True)]
    )


def closed_slopes(synthesis, lengths):
    steps = [misses(synthesis, lengths + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(lengths))]
    return np.array(steps).T


def table(module, work: str, results, monkeypatch, capsys, tmp_path) -> str:
    """What a script prints when its work has had these results; it also writes a picture."""
    monkeypatch.setattr(module, work, lambda derivatives: results.get(derivatives, results["2-point"]))
    monkeypatch.setattr(sys, "argv", ["script", "--plot", str(tmp_path / "plot.png")])
    module.main()
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    return capsys.readouterr().out


def test_synthesis_finds_an_optimum(monkeypatch, capsys, tmp_path):
    """Residuals and derivatives are those of the closed form, the optimum is one there, and differences need more for less."""
    synthesis = example_module("fourbar", "synthesis.py")
    results = {derivatives: synthesis.synthesise(derivatives) for derivatives in ("exact", "2-point")}
    (found, linkage, _), (rough, other, _) = results.values()
    for lengths in (linkage.kernels.p0, found.x):
        np.testing.assert_allclose(linkage.misses(lengths), misses(synthesis, lengths), atol=1e-12)
        np.testing.assert_allclose(linkage.slopes(lengths), closed_slopes(synthesis, lengths), atol=1e-11)
    gradient, rough_gradient = (np.max(np.abs(closed_slopes(synthesis, x).T @ misses(synthesis, x))) for x in (found.x, rough.x))
    assert gradient < 1e-12 < rough_gradient  # 1e-14 to 3e-13, by the compiler's rounding
    assert np.max(np.abs(misses(synthesis, found.x))) < 1e-3
    assert other.evaluations > 2 * linkage.evaluations
    said = table(synthesis, "synthesise", results, monkeypatch, capsys, tmp_path)
    assert f"crank {found.x[0]:.6f}" in said


def test_identification_recovers_the_truth(monkeypatch, capsys, tmp_path):
    """All four masses within four standard deviations; residuals as large as the noise; differences find the same, with a simulation more
    for every mass and step.
    """
    identification = example_module("doublependulum", "identification.py")
    results = {derivatives: identification.identify(derivatives) for derivatives in ("exact", "2-point")}
    (found, experiment, _), (rough, its, _) = results.values()
    true = np.array(list(identification.TRUE.values()))
    deviation = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    assert np.all(np.abs(found.x - true) < 4 * deviation) and np.all(deviation < 0.02 * true)
    freedom = found.fun.size - len(true)
    assert abs(2 * found.cost - freedom) < 4 * np.sqrt(2 * freedom)  # χ² of that many degrees of freedom
    np.testing.assert_allclose(rough.x, found.x, rtol=1e-5)
    assert its.runs == (1 + len(true)) * experiment.runs == 5 * found.nfev
    said = table(identification, "identify", results, monkeypatch, capsys, tmp_path)
    assert all(f"{value:.6f}" in said for value in found.x)


def toe(numbers, angle):
    """Of Jansen's leg, by the intersection of circles in real pairs, so that numbers a to m may be complex."""
    a, b, c, d, e, f, g, h, i, j, k, l, m = numbers

    def corner(p, to_p, q, to_q):
        way = q - p
        square = way @ way
        along = (to_p**2 - to_q**2 + square) / (2 * square)
        return p + along * way + np.sqrt(to_p**2 / square - along**2) * np.array([-way[1], way[0]])

    P, M = np.array([-a, -l]), m * np.array([np.cos(angle), np.sin(angle)])
    U, L = corner(P, b, M, j), corner(M, k, P, c)
    K = corner(L, g, corner(P, d, U, e), f)
    return corner(L, i, K, h)


def test_a_leg_through_given_points(monkeypatch, capsys, tmp_path):
    """Derivatives are those of the circles; the leg found passes within the points' rounding, and most of its numbers are Jansen's."""
    synthesis = example_module("jansen", "synthesis.py")
    found, leg, _ = synthesis.synthesise("exact")

    def misses(x):
        numbers = np.array(synthesis.TRUE, dtype=complex)
        numbers[synthesis.FREE] = x
        return np.concatenate([toe(numbers, angle) - point for angle, point in zip(synthesis.ANGLES, leg.points, strict=True)])

    for x in (synthesis.guess(), found.x):
        if x is not found.x:
            leg.last = leg.turned(synthesis.whole(x))
        closed = np.array([misses(x + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(x))]).T
        np.testing.assert_allclose(leg.slopes(x), closed, atol=1e-11)
        np.testing.assert_allclose(leg.misses(x), misses(x).real, atol=1e-12)
    assert np.max(np.hypot(*leg.misses(found.x).reshape(-1, 2).T)) < 1e-4
    assert np.max(np.abs(leg.slopes(found.x).T @ leg.misses(found.x))) < 1e-9
    assert np.max(np.abs(found.x - synthesis.TRUE[synthesis.FREE])) < 2e-3 < np.max(np.abs(found.x - synthesis.guess()))
    said = table(synthesis, "synthesise", {"2-point": (found, leg, 1.0)}, monkeypatch, capsys, tmp_path)
    assert f"{100 * found.x[0]:8.3f}" in said
