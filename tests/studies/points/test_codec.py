"""A value comes back as it was, by the types of its fields."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from orchestrator.studies.points.codec import packed, unpacked


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Small:
    one: Colour
    many: tuple[Colour, ...]
    two: tuple[str, Colour]
    some: list[Colour]
    named: dict[str, Colour]
    none: Colour | None
    values: NDArray[np.float64]


def test_every_type_of_field_comes_back():
    red, blue = Colour
    given = Small(
        red, (red, blue), ("x", blue), [blue, red], {"a": blue}, None, np.arange(6.0).reshape(2, 3)
    )
    header, arrays = packed(given)
    found = unpacked(Small, header, arrays)
    assert found.values.tolist() == given.values.tolist()
    assert [getattr(found, name) for name in ("one", "many", "two", "some", "named", "none")] == [
        getattr(given, name) for name in ("one", "many", "two", "some", "named", "none")
    ]
    assert type(unpacked(Colour | None, "red", {})) is Colour
