"""Counter-based random numbers: a draw is a pure function of (seed, stream, step, index).

Nothing is consumed and nothing is carried along, so an episode gives the same numbers alone or in a batch, in
any order, on any machine. Each of the four parts passes through the 64-bit finaliser of splitmix64.

Not for secrets: whoever knows the four parts knows the draw.

Source: G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
"""

from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

_GAMMA = 0x9E3779B97F4A7C15
_FIRST = 0xBF58476D1CE4E5B9
_SECOND = 0x94D049BB133111EB
_MASK = (1 << 64) - 1

Words = NDArray[np.uint64]


def word(seed: int, stream: int, step: int, index: int) -> int:
    """Return the 64 random bits at one counter; every part is taken modulo 2**64."""
    bits = 0
    for part in (seed, stream, step, index):
        bits = _finish((bits + (part + 1) * _GAMMA) & _MASK)
    return bits


def words(seed: ArrayLike, stream: ArrayLike, step: ArrayLike, index: ArrayLike) -> Words:
    """Return `word` for every element of the four parts, broadcast against each other."""
    bits: Words = np.zeros((), np.uint64)
    for part in (seed, stream, step, index):
        counter = np.add(np.asarray(part).astype(np.uint64), np.uint64(1))
        bits = _finish_all(np.add(bits, np.multiply(counter, np.uint64(_GAMMA))))
    return bits


@overload
def below(word: int, n: int) -> int: ...
@overload
def below(word: Words, n: ArrayLike) -> NDArray[np.int64]: ...
def below(word: int | Words, n: Any) -> int | NDArray[np.int64]:
    """Return an integer in [0, n) from the upper 32 bits; n < 2**31. Zero where n is zero."""
    if isinstance(word, int):
        return ((word >> 32) * int(n)) >> 32
    return (_upper(word) * np.asarray(n, np.int64)) >> 32


def threshold(p: float) -> int:
    """Return the integer that `chance` compares with: 0 never happens, 2**32 always.

    Raises:
        ValueError: p is not a probability.
    """
    if not 0.0 <= p <= 1.0:
        raise ValueError(f"a probability lies between 0 and 1, not {p}")
    return int(p * 2**32)


@overload
def chance(word: int, threshold: int) -> bool: ...
@overload
def chance(word: Words, threshold: ArrayLike) -> NDArray[np.bool_]: ...
def chance(word: int | Words, threshold: Any) -> bool | NDArray[np.bool_]:
    """Return whether the event of this threshold happens: the upper 32 bits lie below it."""
    if isinstance(word, int):
        return (word >> 32) < int(threshold)
    return np.less(_upper(word), np.asarray(threshold, np.int64))


def _upper(word: Words) -> NDArray[np.int64]:
    return np.right_shift(word, np.uint64(32)).astype(np.int64)


def _finish(bits: int) -> int:
    bits = ((bits ^ (bits >> 30)) * _FIRST) & _MASK
    bits = ((bits ^ (bits >> 27)) * _SECOND) & _MASK
    return bits ^ (bits >> 31)


def _finish_all(bits: Words) -> Words:
    # ufuncs by name: operators on 0-d arrays become scalars, whose overflow warns
    bits = np.multiply(np.bitwise_xor(bits, np.right_shift(bits, np.uint64(30))), np.uint64(_FIRST))
    bits = np.multiply(np.bitwise_xor(bits, np.right_shift(bits, np.uint64(27))), np.uint64(_SECOND))
    return np.bitwise_xor(bits, np.right_shift(bits, np.uint64(31)))
