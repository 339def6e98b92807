"""The exact recursion of a drive that is held, through poles that move slowly.

Each pole has a state z with dz/dt = pole z + u, which a u held over a sample moves exactly;
what is measured is a sum of states times residues, at any instant between two samples.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating]

RATE_HZ = 20_000.0
BLOCK = 32
"""Samples over which poles and residues stay."""


@dataclass(frozen=True, slots=True)
class Poles:
    """Poles in rad/s: real ones that move, one of each pair of complex ones that do not.

    Attributes
    ----------
    moving : ndarray, shape (n_blocks, n_real)
    fixed : ndarray of complex, shape (n_complex,)
    """

    moving: FloatArray
    fixed: ComplexArray


@dataclass(frozen=True, slots=True)
class Residues:
    """Of one measured channel.

    Attributes
    ----------
    moving : ndarray, shape (n_blocks, n_real)
    fixed : ndarray of complex, shape (n_blocks, n_complex)
    """

    moving: FloatArray
    fixed: ComplexArray


def respond(
    drive: FloatArray,
    poles: Poles,
    channels: tuple[tuple[Residues, float], ...],
) -> list[FloatArray]:
    """Return what the channels measure.

    Parameters
    ----------
    drive : ndarray, shape (n_blocks * BLOCK,)
        Each sample held until the next. Before the first, its mean.
    poles : Poles
    channels : tuple of (Residues, float)
        The float is when a sample is taken, s after the drive changes; it may be negative.

    Returns
    -------
    list of ndarray, shape (n_blocks * BLOCK,)
        Where a channel looks beyond the drive, it repeats its last value.
    """
    step = 1.0 / RATE_HZ
    decay, feed = np.exp(poles.moving * step), np.expm1(poles.moving * step) / poles.moving
    turn = np.exp(poles.fixed * step)
    push = np.expm1(poles.fixed * step) / poles.fixed
    mean = float(drive.mean())
    looks = []
    shifts = []
    for residues, at_s in channels:
        whole = int(np.floor(at_s * RATE_HZ))
        looks.append(_looking(residues, poles, at_s - whole * step))
        shifts.append(whole)
    out = np.empty((len(channels), drive.size))
    _run(
        drive,
        decay,
        feed,
        turn,
        push,
        -mean / poles.moving[0],
        -mean / poles.fixed,
        np.stack([look[0] for look in looks]),
        np.stack([look[1] for look in looks]),
        np.stack([look[2] for look in looks]),
        out,
    )
    index = np.arange(drive.size)
    return [
        row[np.clip(index + shift, 0, drive.size - 1)]
        for row, shift in zip(out, shifts, strict=True)
    ]


def _looking(
    residues: Residues, poles: Poles, since_s: float
) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Return factors of the states and of the drive, so long after the drive changed."""
    real = residues.moving * np.exp(poles.moving * since_s)
    pairs = 2.0 * residues.fixed * np.exp(poles.fixed * since_s)
    direct = (residues.moving * np.expm1(poles.moving * since_s) / poles.moving).sum(axis=1)
    of_pairs = 2.0 * residues.fixed * np.expm1(poles.fixed * since_s) / poles.fixed
    return real, pairs, direct + of_pairs.real.sum(axis=1)


@njit(cache=True, nogil=True)
def _run(drive, decay, feed, turn, push, real, pairs, on_real, on_pairs, direct, out):  # type: ignore[no-untyped-def]
    channels = out.shape[0]
    for block in range(decay.shape[0]):
        for sample in range(block * BLOCK, (block + 1) * BLOCK):
            held = drive[sample]
            for channel in range(channels):
                out[channel, sample] = direct[channel, block] * held
            for k in range(real.size):
                state = real[k]
                for channel in range(channels):
                    out[channel, sample] += on_real[channel, block, k] * state
                real[k] = decay[block, k] * state + feed[block, k] * held
            for k in range(pairs.size):
                now = pairs[k]
                for channel in range(channels):
                    on = on_pairs[channel, block, k]
                    out[channel, sample] += on.real * now.real - on.imag * now.imag
                pairs[k] = turn[k] * now + push[k] * held
