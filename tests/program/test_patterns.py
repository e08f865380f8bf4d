"""Products of matrices that are a pattern and values, beside those of SciPy."""

import numpy as np
import scipy.sparse

from ncgen.program.ir.blocks import Pattern


def test_products_and_diagonals():
    random = np.random.default_rng(2)
    for shape in ((5, 7), (7, 5), (6, 6), (0, 4), (3, 0)):
        dense = random.standard_normal(shape) * (random.random(shape) < 0.4)
        matrix = scipy.sparse.csr_array(dense)
        pattern = Pattern.of(shape, [(int(i), int(j)) for i, j in zip(*np.nonzero(dense), strict=True)])
        x = random.standard_normal(shape[1])
        np.testing.assert_allclose(pattern.times(matrix.data, x), dense @ x, rtol=1e-13, atol=1e-15)
        if shape[0] == shape[1]:
            assert np.array_equal(pattern.diagonal(matrix.data), np.diag(dense))
