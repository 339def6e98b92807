"""Least squares of tones and a trend from sums over blocks, compiled.

The basis is Legendre polynomials, each straight within a block of samples, then the cosines,
then the sines. Time runs from the middle of the segment in samples, so that cosines and sines
are orthogonal. The noise around a tone is the residual's periodogram at the frequencies next to
it, in which what the tones leave there is known in closed form.
"""

import numpy as np
from numba import njit

from frictus_service.identification.observation.blocks import BLOCK, RAMP

NOISE_BINS = 8
"""Noise is measured at so many frequencies on either side of a tone, 1 / duration apart, as far
as they lie within half the tone's frequency of it; at two at least."""


@njit(cache=True, nogil=True)
def solve(sums, columns, weights, omega, degree, lacking, lacks):  # type: ignore[no-untyped-def]
    """Return amplitudes about the middle of a segment, and their variances.

    Parameters
    ----------
    sums : ndarray, shape (n_columns, n_blocks, 2 + 2 n_tones)
        From `blocks.sum_blocks`.
    columns : ndarray of int, shape (n_channels,)
        How many of the columns belong to each channel.
    weights : ndarray, shape (n_columns,)
    omega : ndarray, shape (n_tones,)
        Radians per sample.
    degree : int
        Of the trend, 1 at least.
    lacking : ndarray
        Missing samples of all channels, one channel after the other, from the middle.
    lacks : ndarray of int, shape (n_channels,)
        How many of them belong to each channel.

    Returns
    -------
    amplitude : ndarray of complex, shape (n_channels, n_tones)
    variance : ndarray, shape (n_channels, n_tones)
        Of the real and of the imaginary part each.
    """
    blocks, tones, order = sums.shape[1], omega.size, degree + 1
    level, rise = _trend(blocks, degree)
    turned = _turned(omega, blocks)
    flat, tilt = _block_response(omega)
    normal = _normal_matrix(level, rise, turned, omega, flat, tilt)
    shared = _inverse(normal)
    residual = np.empty((columns.size, tones, blocks), dtype=np.complex128)
    amplitude = np.empty((columns.size, tones), dtype=np.complex128)
    spread = np.empty((columns.size, tones))
    column, gone = 0, 0
    for channel in range(columns.size):
        weighted = np.zeros((blocks, 2 + 2 * tones))
        for _ in range(columns[channel]):
            weighted += weights[column] * sums[column]
            column += 1
        samples = lacking[gone : gone + lacks[channel]]
        gone += lacks[channel]
        inverse = shared
        basis = _basis(samples, level, rise, omega)
        if samples.size > 0:
            inverse = _inverse(_without(normal, basis))
        held = residual[channel]
        _shift(weighted, turned, held)
        solved = _times(inverse, _right_side(weighted, held, level, rise))
        _subtract_trend(held, turned, solved[:order], level, rise, flat, tilt)
        _fill(held, samples, _times(basis, solved), omega)
        for tone in range(tones):
            cosine, sine = order + tone, order + tones + tone
            amplitude[channel, tone] = solved[cosine] - 1j * solved[sine]
            spread[channel, tone] = (inverse[cosine, cosine] + inverse[sine, sine]) / 2.0
    return amplitude, spread * _noise_power(residual, amplitude, omega, lacks)


@njit(cache=True, nogil=True)
def _times(matrix, vector):  # type: ignore[no-untyped-def]
    out = np.zeros(matrix.shape[0])
    for row in range(matrix.shape[0]):
        for column in range(vector.size):
            out[row] += matrix[row, column] * vector[column]
    return out


@njit(cache=True, nogil=True)
def _inverse(matrix):  # type: ignore[no-untyped-def]
    """Return the inverse of a positive definite matrix, by Gauss and Jordan.

    A linear algebra library would wake threads for it, ten times as slow on a busy machine.
    """
    size = matrix.shape[0]
    inverse = matrix.copy()
    for pivot in range(size):
        by = 1.0 / inverse[pivot, pivot]
        inverse[pivot, pivot] = 1.0
        inverse[pivot] *= by
        for row in range(size):
            if row != pivot:
                times = inverse[row, pivot]
                inverse[row, pivot] = 0.0
                inverse[row] -= times * inverse[pivot]
    return inverse


@njit(cache=True, nogil=True)
def _without(normal, basis):  # type: ignore[no-untyped-def]
    """Return normal equations without some samples, of which the basis is given."""
    left = normal.copy()
    for sample in range(basis.shape[0]):
        for row in range(left.shape[0]):
            left[row] -= basis[sample, row] * basis[sample]
    return left


@njit(cache=True, nogil=True)
def _trend(blocks, degree):  # type: ignore[no-untyped-def]
    """Return Legendre polynomials at the middle of each block, and their rise per sample."""
    level = np.ones((degree + 1, blocks))
    rise = np.zeros((degree + 1, blocks))
    scaled = (2.0 * np.arange(blocks) + 1.0) / blocks - 1.0
    per_sample = 2.0 / (blocks * BLOCK)
    level[1] = scaled
    rise[1] = per_sample
    for n in range(1, degree):
        level[n + 1] = ((2 * n + 1) * scaled * level[n] - n * level[n - 1]) / (n + 1)
        rise[n + 1] = rise[n - 1] + (2 * n + 1) * level[n] * per_sample
    return level, rise


@njit(cache=True, nogil=True)
def _turned(omega, blocks):  # type: ignore[no-untyped-def]
    """Return exp(i omega n) at the middle of each block, (n_tones, n_blocks)."""
    turned = np.empty((omega.size, blocks), dtype=np.complex128)
    for tone in range(omega.size):
        step = np.exp(1j * omega[tone] * BLOCK)
        now = np.exp(-0.5j * omega[tone] * BLOCK * (blocks - 1))
        for block in range(blocks):
            turned[tone, block] = now
            now *= step
    return turned


@njit(cache=True, nogil=True)
def _block_response(omega):  # type: ignore[no-untyped-def]
    """Return the sums of cosine, and of ramp times sine, over a block, per tone."""
    turned = np.outer(omega, RAMP)
    return np.cos(turned).sum(axis=1), (RAMP * np.sin(turned)).sum(axis=1)


@njit(cache=True, nogil=True)
def _dirichlet(omega, count):  # type: ignore[no-untyped-def]
    """Return the sum of cos(omega n) over so many n, one apart, about zero."""
    half = np.sin(omega / 2.0)
    if abs(half) < 1e-9:  # omega is a multiple of 2 pi
        turns = round(omega / (2.0 * np.pi))
        return count * (1.0 if turns % 2 == 0 or count % 2 == 1 else -1.0)
    return np.sin(omega * count / 2.0) / half


@njit(cache=True, nogil=True)
def _normal_matrix(level, rise, turned, omega, flat, tilt):  # type: ignore[no-untyped-def]
    """Return the sums over all samples of products of the basis."""
    order, tones = level.shape[0], omega.size
    samples = level.shape[1] * BLOCK
    normal = np.zeros((order + 2 * tones, order + 2 * tones))
    ramp2 = np.sum(RAMP * RAMP)
    for p in range(order):
        for q in range(p + 1):
            product = np.sum(BLOCK * level[p] * level[q] + ramp2 * rise[p] * rise[q])
            normal[p, q] = normal[q, p] = product
    for i in range(tones):
        cosine, sine = order + i, order + tones + i
        for p in range(order):
            of_level = np.sum(level[p] * turned[i]) * flat[i]
            of_rise = np.sum(rise[p] * turned[i]) * 1j * tilt[i]
            mixed = of_level + of_rise
            normal[p, cosine] = normal[cosine, p] = mixed.real
            normal[p, sine] = normal[sine, p] = mixed.imag
        for j in range(tones):
            apart = _dirichlet(omega[i] - omega[j], samples)
            total = _dirichlet(omega[i] + omega[j], samples)
            normal[cosine, order + j] = (apart + total) / 2.0
            normal[sine, order + tones + j] = (apart - total) / 2.0
    return normal


@njit(cache=True, nogil=True)
def _basis(samples, level, rise, omega):  # type: ignore[no-untyped-def]
    """Return the basis at single samples, counted from the middle: (n_samples, size)."""
    order, tones = level.shape[0], omega.size
    basis = np.empty((samples.size, order + 2 * tones))
    first = (level.shape[1] - 1) / 2.0
    for row in range(samples.size):
        block = int(samples[row] / BLOCK + first + 0.5)
        since = samples[row] - (block - first) * BLOCK
        for p in range(order):
            basis[row, p] = level[p, block] + rise[p, block] * since
        for tone in range(tones):
            basis[row, order + tone] = np.cos(omega[tone] * samples[row])
            basis[row, order + tones + tone] = np.sin(omega[tone] * samples[row])
    return basis


@njit(cache=True, nogil=True)
def _shift(sums, turned, held):  # type: ignore[no-untyped-def]
    """Set the sums of samples times exp(-i omega n), per tone and block."""
    tones, blocks = turned.shape
    for tone in range(tones):
        for block in range(blocks):
            summed = sums[block, 2 + tone] - 1j * sums[block, 2 + tones + tone]
            held[tone, block] = summed * np.conj(turned[tone, block])


@njit(cache=True, nogil=True)
def _right_side(sums, held, level, rise):  # type: ignore[no-untyped-def]
    order, tones = level.shape[0], held.shape[0]
    right = np.empty(order + 2 * tones)
    for p in range(order):
        right[p] = np.sum(level[p] * sums[:, 0] + rise[p] * sums[:, 1])
    for tone in range(tones):
        summed = np.sum(held[tone])
        right[order + tone] = summed.real
        right[order + tones + tone] = -summed.imag
    return right


@njit(cache=True, nogil=True)
def _subtract_trend(held, turned, solved, level, rise, flat, tilt):  # type: ignore[no-untyped-def]
    blocks = held.shape[1]
    at, up = np.zeros(blocks), np.zeros(blocks)
    for p in range(solved.size):
        at += solved[p] * level[p]
        up += solved[p] * rise[p]
    for tone in range(held.shape[0]):
        held[tone] -= np.conj(turned[tone]) * (at * flat[tone] - 1j * up * tilt[tone])


@njit(cache=True, nogil=True)
def _fill(held, samples, expected, omega):  # type: ignore[no-untyped-def]
    """Put what was fitted in the place of missing samples, so that no residual remains."""
    first = (held.shape[1] - 1) / 2.0
    for row in range(samples.size):
        block = int(samples[row] / BLOCK + first + 0.5)
        for tone in range(omega.size):
            held[tone, block] += expected[row] * np.exp(-1j * omega[tone] * samples[row])


@njit(cache=True, nogil=True)
def _noise_power(residual, amplitude, omega, lacks):  # type: ignore[no-untyped-def]
    """Return the variance of white noise as strong as the residual is around each tone.

    A bin in which a tone lies holds no noise, because the fit took it too: of each bin the
    share counts that the tones leave, as if they were orthogonal. What the trend takes is left
    out; it does not reach so far up.

    Parameters
    ----------
    residual : ndarray of complex, shape (n_channels, n_tones, n_blocks)
        Shifted down by each tone; the trend is subtracted, the tones are not.
    amplitude : ndarray of complex, shape (n_channels, n_tones)
    omega : ndarray, shape (n_tones,)
    lacks : ndarray, shape (n_channels,)
        How many samples are missing, where no residual remains.
    """
    channels, tones, blocks = residual.shape
    samples = blocks * BLOCK
    power = np.zeros((channels, tones))
    for tone in range(tones):
        reach = noise_reach(omega[tone], samples)
        offs = np.array([_off(number, reach) for number in range(2 * reach)])
        turns = np.exp(1j * np.pi * offs / blocks)
        total = _around(residual, tone, reach)
        taken = np.zeros(2 * reach)
        for other in range(tones):
            # Bins are whole turns away from the tone itself, which leaves nothing there.
            if other != tone:
                below = _leak(omega[other] - omega[tone], reach, blocks, turns)
                _subtract(total, amplitude[:, other], below)
                taken += np.square(2.0 * below / samples)
            above = _leak(-omega[other] - omega[tone], reach, blocks, turns)
            _subtract(total, np.conj(amplitude[:, other]), above)
            taken += np.square(2.0 * above / samples)
        left = max(np.sum(1.0 - np.minimum(taken, 1.0)), 1.0)
        for channel in range(channels):
            strength = np.sum(total[channel].real ** 2 + total[channel].imag ** 2)
            power[channel, tone] = strength / (left * (samples - lacks[channel]))
    return power


@njit(cache=True, nogil=True)
def noise_reach(omega, samples):  # type: ignore[no-untyped-def]
    """Return at how many frequencies on either side the noise around a tone is measured.

    Parameters
    ----------
    omega : float
        Radians per sample.
    samples : int
        Length of the segment.
    """
    within = omega * samples / (4.0 * np.pi)
    return int(min(max(within, 2.0), float(NOISE_BINS)))


@njit(cache=True, nogil=True)
def _off(number, reach):  # type: ignore[no-untyped-def]
    """Return the bins -reach to -1, and 1 to reach, in turn."""
    return number - reach if number < reach else number - reach + 1


@njit(cache=True, nogil=True)
def _around(residual, tone, reach):  # type: ignore[no-untyped-def]
    """Return the sums of the residual at the bins around a tone, (n_channels, n_bins)."""
    channels, _, blocks = residual.shape
    total = np.zeros((channels, 2 * reach), dtype=np.complex128)
    for number in range(2 * reach):
        turn = -2j * np.pi * _off(number, reach) / blocks
        step = np.exp(turn)
        now = np.exp(-turn * (blocks - 1) / 2.0)
        for block in range(blocks):
            for channel in range(channels):
                total[channel, number] += residual[channel, tone, block] * now
            now *= step
    return total


@njit(cache=True, nogil=True)
def _leak(apart, reach, blocks, turns):  # type: ignore[no-untyped-def]
    """Return what half a unit phasor, so far apart from a tone, leaves in the bins around it.

    It is the sum of exp(i apart n) within a block, times the sum of exp(i (32 apart - turn) b)
    over the blocks, whose numerator is the same in all bins but for its sign.
    """
    within = _dirichlet(apart, BLOCK) / 2.0
    sine, cosine = np.sin(apart * BLOCK / 2.0), np.cos(apart * BLOCK / 2.0)
    numerator = np.sin(apart * BLOCK * blocks / 2.0)
    leak = np.empty(2 * reach)
    for number in range(2 * reach):
        off = _off(number, reach)
        divisor = sine * turns[number].real - cosine * turns[number].imag
        if abs(divisor) < 1e-9:  # it lies in this very bin
            turn = 2.0 * np.pi * off / blocks
            leak[number] = within * _dirichlet(apart * BLOCK - turn, blocks)
        else:
            sign = 1.0 if off % 2 == 0 else -1.0
            leak[number] = within * sign * numerator / divisor
    return leak


@njit(cache=True, nogil=True)
def _subtract(total, amplitude, leak):  # type: ignore[no-untyped-def]
    for channel in range(total.shape[0]):
        for number in range(leak.size):
            total[channel, number] -= amplitude[channel] * leak[number]
