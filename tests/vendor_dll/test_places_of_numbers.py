"""Where a DLL's memory holds numbers that move: doubles, and floats of both halves of a word."""

import struct
from types import SimpleNamespace

from fmus.vendor_dll.interface import DllParameter, layout
from fmus.vendor_dll.state_trial import _Host, _numbers

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


TYPES = {"b": 2, "d": 9, "i": 6, "s": 10}
"""Numbers of the interface's types, by the letter that `struct` has for their content."""


def test_defaults_stand_where_a_compiler_puts_them_and_a_text_at_its_address():
    memory, room = {}, 4096
    library = SimpleNamespace(
        allocate=lambda size: room,
        write=lambda address, content: memory.update({address: content}),
    )
    defaults = (("b", 1), ("d", 2.5), ("i", -7), ("s", "abc"))
    parameters = [
        DllParameter(letter, "", "", "", TYPES[letter], True, default, None, None)
        for letter, default in defaults
    ]
    found = layout(parameters)
    host = object.__new__(_Host)
    host._library, host._sizes, host._at = library, [0, 0, found.size], [0, 0, 64]
    host._set_defaults(parameters, found)
    assert struct.unpack("@bdiP", memory[64]) == (1, 2.5, -7, room)
    assert memory[room] == b"abc\0"
