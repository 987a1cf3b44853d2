"""Factors of positive definite matrices against dense solutions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

from tests.meshes import icosphere
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, cotan_laplacian
from vhquad.geometry.sparse import SymmetricFactor


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("columns", [None, 3])
def test_inverse_of_a_shifted_laplacian(
    order: int, columns: int | None, rng: np.random.Generator
) -> None:
    """Scalar and connection Laplacian, one right-hand side and several."""
    mesh = icosphere(2)
    tri = intrinsic_delaunay(mesh, build_frames(mesh))
    laplacian = connection_laplacian(tri, order=1) if order else cotan_laplacian(tri)
    matrix = csr_matrix(laplacian + 0.1 * diags_array(np.ones(mesh.n_vertices)))
    shape = (mesh.n_vertices,) if columns is None else (mesh.n_vertices, columns)
    right = rng.normal(size=shape).astype(matrix.dtype)
    expected = np.linalg.solve(matrix.toarray(), right)
    factor = SymmetricFactor(matrix)
    np.testing.assert_allclose(factor.solve(right), expected, atol=1e-10)
    rows = factor.order
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(right)))
    np.testing.assert_allclose(factor.solve_in_order(right[rows]), expected[rows], atol=1e-10)
    other = csr_matrix(laplacian + 3.0 * diags_array(np.ones(mesh.n_vertices)))
    again = SymmetricFactor(other, like=factor)
    expected_again = np.linalg.solve(other.toarray(), right)
    np.testing.assert_allclose(again.solve(right), expected_again, atol=1e-10)
    third = SymmetricFactor(matrix, like=again)
    np.testing.assert_allclose(third.solve(right), expected, atol=1e-10)
    np.testing.assert_array_equal(third.order, again.order)  # nothing left to permute
    single = np.complex64 if order else np.float32
    found = SymmetricFactor(matrix.astype(single)).solve(right.astype(single))
    assert found.dtype == single
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_an_indefinite_matrix_in_single_precision(rng: np.random.Generator) -> None:
    """With rows changing places it is as good as a definite one."""
    mesh = icosphere(3)
    laplacian = cotan_laplacian(intrinsic_delaunay(mesh, build_frames(mesh)))
    matrix = csr_matrix(laplacian - 0.5 * diags_array(np.ones(mesh.n_vertices)))
    right = rng.normal(size=(mesh.n_vertices, 3))
    expected = np.linalg.solve(matrix.toarray(), right)
    factor = SymmetricFactor(matrix.astype(np.float32), definite=False)
    found = factor.solve(right.astype(np.float32))
    assert np.linalg.norm(found - expected) < 1e-4 * np.linalg.norm(expected)
