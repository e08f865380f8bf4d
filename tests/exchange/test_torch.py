"""Motions in PyTorch: values and derivatives are ncgen's own, of one and of many, under autograd and torch.func."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from swing import swing

import ncgen
from ncgen import ModelError

torch = pytest.importorskip("torch")
STEPS = 20
P, RATES = np.array([0.9, 1.7]), np.array([1.3])


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(swing())


@pytest.fixture(scope="module")
def motion(kernels):
    return ncgen.torch(kernels).motion(0.4, STEPS)


def tensor(array):
    return torch.tensor(array, dtype=torch.float64, requires_grad=True)


def number(q, qd):
    return q[..., -1, 0] * qd[..., 3, 1] + (qd[..., -1, :] ** 2).sum(-1)


def expected(kernels, p, rates):
    """The number of one motion, and its slopes by p and rates, through derivatives that went forward."""
    found = ncgen.sensitivities(kernels, 0.4, STEPS, p=p, zd0=rates)
    by_q, by_qd = np.zeros_like(found.q), np.zeros_like(found.q)
    by_q[-1, 0], by_qd[3, 1] = found.qd[3, 1], found.q[-1, 0]
    by_qd[-1] += 2 * found.qd[-1]
    slopes = np.einsum("kn,knc->c", by_q, found.q_by) + np.einsum("kn,knc->c", by_qd, found.qd_by)
    return number(found.q, found.qd), slopes[:2], slopes[-1:]


def test_value_and_gradient(kernels, motion):
    p, rates = tensor(P), tensor(RATES)
    value = number(*motion(p, rates))
    value.backward()
    wanted, by_p, by_rates = expected(kernels, P, RATES)
    assert value.item() == pytest.approx(wanted, rel=1e-13)
    assert p.grad.numpy() == pytest.approx(by_p, rel=1e-11)
    assert rates.grad.numpy() == pytest.approx(by_rates, rel=1e-11)


def test_many_at_once(kernels, motion):
    """Leading axes, which broadcast; torch.func.vmap; both give each motion its own numbers."""
    several, speeds = np.linspace(0.8, 1.2, 5)[:, None] * P, np.linspace(-1, 1, 3)[:, None]
    p, rates = tensor(several), tensor(speeds)
    values = number(*motion(p[:, None], rates))
    assert values.shape == (5, 3)
    values.sum().backward()
    found = [[expected(kernels, a, b) for b in speeds] for a in several]
    assert values.detach().numpy() == pytest.approx(np.array([[one[0] for one in row] for row in found]), rel=1e-12)
    assert p.grad.numpy() == pytest.approx(np.array([sum(one[1] for one in row) for row in found]), rel=1e-10)
    gradients = torch.func.vmap(torch.func.grad(lambda p, rates: number(*motion(p, rates)), argnums=(0, 1)), (0, None))
    by_p, by_rates = gradients(torch.tensor(several), torch.tensor(speeds[2]))
    assert by_p.numpy() == pytest.approx(np.array([row[2][1] for row in found]), rel=1e-10)
    assert by_rates.numpy() == pytest.approx(np.array([row[2][2] for row in found]), rel=1e-10)


def test_amid_other_functions(kernels, motion):
    """A network's worth of arithmetic before and after: the chain rule goes through, and an optimiser's step lowers the loss."""
    weights = tensor([0.1, -0.2])
    optimiser = torch.optim.SGD([weights], lr=1e-3)
    losses = []
    for _ in range(3):
        optimiser.zero_grad()
        loss = ((motion(torch.tensor(P) * weights.exp(), torch.tensor(RATES))[0][-1] - 0.3) ** 2).sum()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[0] > losses[1] > losses[2]


def test_arrays_that_cannot_be_written_to(kernels, motion):
    """The kernels' own defaults among them: no word of PyTorch's about it."""
    assert not kernels.p0.flags.writeable
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert motion(kernels.p0, RATES)[0].shape == (STEPS + 1, kernels.n)


def test_refusals(kernels, motion):
    functions = ncgen.torch(kernels)
    assert functions.rates_of() == ("psi",)
    with pytest.raises(ModelError, match=r"^swing: p has shape \(3,\); it must be \(2,\)$"):
        motion(np.ones(3), RATES)
    with pytest.raises(ModelError, match=r"^swing: rates has shape \(\); it must be \(1,\)$"):
        motion(P, 1.0)
    with pytest.raises(ModelError, match=r"^swing: p and rates have shapes \(2, 2\) and \(3, 1\), which do not fit one batch of motions$"):
        motion(np.ones((2, 2)), np.ones((3, 1)))
    with pytest.raises(ModelError, match=r"^swing: p and rates have shapes \(0, 2\) and \(1,\), which do not fit one batch of motions$"):
        motion(np.ones((0, 2)), RATES)
    with pytest.raises(ModelError, match="^swing: p is of type complex128; it must be real numbers$"):
        motion(P * 1j, RATES)
    with pytest.raises(ModelError, match="^swing: rates is no array of numbers$"):
        motion(P, ["fast"])
    with pytest.raises(ModelError, match="^swing: p is on meta; motions are computed by the processor: give p.cpu()"):
        motion(torch.ones(2, device="meta"), RATES)
    with pytest.raises(ModelError, match="^ncgen.torch: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out$"):
        functions.motion(0.4, STEPS, p=P)
    p = tensor(P)
    (by_p,) = torch.autograd.grad(number(*motion(p, torch.tensor(RATES))), p, create_graph=True)
    with pytest.raises(ModelError, match="^ncgen.torch: motions have first derivatives only; take ncgen.hessian for second ones$"):
        by_p.sum().backward()
    with pytest.raises(ncgen.NcgenError, match="^motion 1 of 2: p: length is nan; it must be a finite number$"):
        motion(np.array([P, [np.nan, 1.0]]), RATES)
