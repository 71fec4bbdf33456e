"""Conversion of decimal numbers in text to the nearest float64, compiled.

The result is that of Python's `float`. Method: product with a power of five of 128 bits (D. Lemire,
Number Parsing at a Gigabyte per Second, 2021). Where that does not decide (one number in billions),
and for words that are not plain decimal numbers, no result is returned: the caller uses Python.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slideviz.system.jit_cache import njit

_LEAST = -342  # power of ten below which a number of 19 digits is zero
_MOST = 308  # and above which it is infinite
_DIGITS = 19  # how many decimal digits fit into 64 bits


def _powers_of_five() -> NDArray[np.uint64]:
    """Return the first 128 bits of 5^q for q from _LEAST to _MOST: (651, 2), high and low 64."""
    rows = []
    for q in range(_LEAST, _MOST + 1):
        power = 5 ** abs(q)
        if q < 0:
            size = power.bit_length()
            # For q below -27 the quotient is rounded up, for it is never exact.
            power = (1 << (size + 127 if q >= -27 else 2 * size + 128)) // power + 1
        shift = power.bit_length() - 128
        first = power >> shift if shift > 0 else power << -shift
        rows.append((first >> 64, first & ((1 << 64) - 1)))
    return np.array(rows, np.uint64)


_POWERS = _powers_of_five()
_U0 = np.uint64(0)
_U1 = np.uint64(1)
_U3 = np.uint64(3)
U10 = np.uint64(10)
_U32 = np.uint64(32)
U48 = np.uint64(48)
_U63 = np.uint64(63)
# Bits of uint64 and of a float64: lowest 32; all; numbers with the highest byte or bit set are not
# below these; the mantissa's limit, and the highest bit of it, which a float64 does not store.
_LOW = np.uint64(0xFFFFFFFF)
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
_BYTE_FREE = np.uint64(1 << 56)
_BIT_FREE = np.uint64(1 << 63)
_WHOLE = np.uint64(1 << 53)
_SPARE = np.uint64(0x1FF)
"""The bits of a product's high half that a float64 and its rounding do not need."""
_HIDDEN = np.uint64(1 << 52)


@njit(inline="always")
def _product(a, b):  # type: ignore[no-untyped-def]
    """Return the high and the low 64 bits of the product of two uint64."""
    a0 = a & _LOW
    a1 = a >> _U32
    b0 = b & _LOW
    b1 = b >> _U32
    low = a0 * b0
    middle = a1 * b0
    middle += low >> _U32
    cross = a0 * b1 + (middle & _LOW)
    return a1 * b1 + (middle >> _U32) + (cross >> _U32), a * b


@njit
def nearest_bits(digits, q):  # type: ignore[no-untyped-def]
    """Return the bits (uint64) of the float64 nearest to digits x 10^q, or all ones if undecided.

    Undecided are also numbers that are subnormal or infinite. ``digits``: not 0. ``q``: the power
    of ten.
    """
    if q < _LEAST or q > _MOST:
        return _ALL
    shift = 0
    while digits < _BYTE_FREE:
        digits <<= np.uint64(8)
        shift += 8
    while digits < _BIT_FREE:
        digits <<= _U1
        shift += 1
    high, low = _product(digits, _POWERS[q - _LEAST, 0])
    if high & _SPARE == _SPARE:
        more = _product(digits, _POWERS[q - _LEAST, 1])[0]
        low += more
        if low < more:
            high += _U1
        if low == _ALL and (q < -27 or q > 55):
            return _ALL
    top = high >> _U63
    down = top + np.uint64(9)
    mantissa = high >> down
    power = ((217706 * q) >> 16) + 63 + np.int64(top) - shift + 1023
    if power <= 0:
        return _ALL
    # Exactly between two float64: the even one.
    halfway = low <= _U1 and -4 <= q <= 23 and mantissa & _U3 == _U1
    if halfway and mantissa << down == high:
        mantissa &= ~_U1
    mantissa = (mantissa + (mantissa & _U1)) >> _U1
    if mantissa >= _WHOLE:
        mantissa = _HIDDEN
        power += 1
    if power >= 2047:
        return _ALL
    return (mantissa & ~_HIDDEN) | (np.uint64(power) << np.uint64(52))


@njit(inline="always")
def ends(code):  # type: ignore[no-untyped-def]
    """Return whether a byte ends a word: a blank, a line break or ``%`` (begin of a comment)."""
    return code == 32 or 9 <= code <= 13 or code == 37


@njit
def decimal(text, offset, bits, k):  # type: ignore[no-untyped-def]
    """Write the bits of the number that begins at ``text[at]`` to ``bits[k]``; return its end.

    The result is -1, and nothing is written, if it is not a plain number or `nearest_bits` is
    undecided.
    ``text`` (b,) uint8: the text; its last byte is a line break.
    ``offset``: index of the first byte of the number.
    ``bits`` (v,) uint64: receives the bits of the float64.
    ``k``: the place in ``bits``.
    """
    sign = np.uint64(text[offset] == 45) << _U63
    offset += (text[offset] == 45) | (text[offset] == 43)
    first = offset
    q = 0
    more = False
    digits, offset = _digits(text, offset, _U0)
    length = offset - first
    if text[offset] == 46:
        digits, stop = _digits(text, offset + 1, digits)
        q = offset + 1 - stop
        length -= q
        offset = stop
    if length == 0:
        return -1
    if length > _DIGITS:
        digits, q, more = _first_digits(text, first)
    code = text[offset]
    if code == 101 or code == 69:
        offset, exponent = _exponent(text, offset + 1)
        if offset < 0:
            return -1
        q += exponent
    if not ends(text[offset]):
        return -1
    if digits == _U0:
        bits[k] = sign
        return offset
    nearest = nearest_bits(digits, q)
    if nearest == _ALL or (more and nearest != nearest_bits(digits + _U1, q)):
        return -1
    bits[k] = nearest | sign
    return offset


@njit(inline="always")
def _digits(text, offset, value):  # type: ignore[no-untyped-def]
    """Append the digits from ``text[at]`` on to ``value``, modulo 2^64; return it and the end."""
    digit = np.uint64(text[offset]) - U48
    while digit < U10:
        value = value * U10 + digit
        offset += 1
        digit = np.uint64(text[offset]) - U48
    return value, offset


@njit
def _first_digits(text, offset):  # type: ignore[no-untyped-def]
    """Return the first 19 digits of a long number, its power of ten, and whether more follow.

    Leading zeros do not count. The number begins at ``text[at]``; its exponent is not read.
    """
    value = _U0
    count = 0
    q = 0
    point = False
    more = False
    while True:
        digit = np.uint64(text[offset]) - U48
        if digit < U10 and count < _DIGITS:
            value = value * U10 + digit
            count += value != _U0
            q -= point
        elif digit < U10:
            more = True
            q += not point
        elif text[offset] == 46 and not point:
            point = True
        else:
            return value, q, more
        offset += 1


@njit(inline="always")
def _exponent(text, offset):  # type: ignore[no-untyped-def]
    """Return the end of the exponent at ``text[at]`` (-1: not 1 to 5 digits), and its value."""
    down = text[offset] == 45
    if down or text[offset] == 43:
        offset += 1
    first = offset
    value = 0
    while 48 <= text[offset] <= 57 and offset < first + 6:
        value = value * 10 + (text[offset] - 48)
        offset += 1
    if offset == first or offset == first + 6:
        return -1, 0
    return offset, -value if down else value
