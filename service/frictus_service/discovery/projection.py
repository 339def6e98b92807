"""Projections onto what columns span, and what they leave of others."""

from typing import Final

import numpy as np
from scipy import linalg

from frictus_hardware.arrays import BoolArray, FloatArray

LEAST_SHARE: Final = 1e-3
"""What own parameters and causes already named leave of a signature, as a share of its square,
below which a unit says nothing about it; and so does one below this share of what is left in
the others."""

ROUNDING: Final = 1e-15
"""Eigenvalue, of the largest, from which a direction is more than rounding."""


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what columns span; dependent ones add nothing.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
    """
    size = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    scaled = columns[:, size > 0.0] / size[size > 0.0]
    if not scaled.shape[1]:
        return np.zeros((columns.shape[0], 0))
    left, values = left_singular(scaled)
    basis: FloatArray = left[:, values > 1e-9 * values[0]]
    return basis


def orthogonal_to(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Return what a projection onto a basis leaves of columns.

    Parameters
    ----------
    basis : ndarray, shape (n, k)
        Orthonormal.
    columns : ndarray, shape (n,) or (n, m)
    """
    left: FloatArray = columns - basis @ (basis.T @ columns)
    return left


def hardly_left(left: FloatArray, whole: FloatArray) -> BoolArray:
    """Return of which signatures a projection left next to nothing, see `LEAST_SHARE`.

    Parameters
    ----------
    left, whole : ndarray, shape (n, n_effects)
    """
    rest, before = np.square(left).sum(axis=0), np.square(whole).sum(axis=0)
    return np.asarray(rest <= LEAST_SHARE * before)


def left_singular(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the left singular vectors of a matrix, and its singular values.

    The usual driver (divide and conquer, ``gesdd``) does not converge on a rare matrix that is
    as good as any other, 2 of 519 simulated studies had one; the older one (``gesvd``) does.

    Parameters
    ----------
    columns : ndarray, shape (n, k)

    Returns
    -------
    vectors : ndarray, shape (n, min(n, k))
    values : ndarray, shape (min(n, k),)
        Falling.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    try:
        left, values, _ = np.linalg.svd(columns, full_matrices=False)
    except np.linalg.LinAlgError:
        left, values, _ = linalg.svd(columns, full_matrices=False, lapack_driver="gesvd")
    return left, values


def inverse_of(gram: FloatArray, least: float) -> FloatArray:
    """Return the pseudo-inverse of inner products, which knows no units of coefficients.

    Parameters
    ----------
    gram : ndarray, shape (k, k)
        Of columns; of one that is empty the inverse is 0.
    least : float
        Eigenvalue, of the largest, from which columns of length 1 are told apart.
    """
    size = np.sqrt(np.diagonal(gram))
    per_unit = np.divide(1.0, size, out=np.zeros(size.shape), where=size > 0.0)
    scaled = per_unit[:, np.newaxis] * gram * per_unit
    inverse = np.linalg.pinv(scaled, rcond=least, hermitian=True)
    found: FloatArray = per_unit[:, np.newaxis] * inverse * per_unit
    return found
