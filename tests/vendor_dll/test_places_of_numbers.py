"""Where a DLL's memory holds numbers that move: doubles, and floats of both halves of a word."""

import struct

from fmus.vendor_dll.state_trial import _numbers

ODD = 1e-30
"""As a half of a word it makes no modest double; as a float it is none either."""


def places(*moments, start=16, base=0):
    memory = [struct.pack("8x") + words for words in moments]
    return _numbers([(base, start - 8, len(memory[0]))], [[m] for m in memory])


def word(*floats):
    return struct.pack("2f", *floats)


def test_a_double_and_the_floats_of_either_half():
    one = struct.pack("d", 1.5) + word(2.0, ODD) + word(1e-11, 1e-11)
    two = struct.pack("d", 2.5) + word(3.0, ODD) + word(1e-11, 2e-11)
    assert places(one, two) == ((16,), (24, 36))


def test_what_stays_is_no_state():
    still = struct.pack("d", 1.5) + word(2.0, 1e-11)
    assert places(still, still) == ((), ())
