"""Which rating of a binding does not fit to the start values that the FMU has by itself."""

from types import SimpleNamespace

import pytest

from orchestrator.devices.fmi.port_mapping import BoundDescription


def unlike(V_n=None, **starts):
    """``starts``: by the port's name, the FMU's own start value and unit, and the binding's factor."""
    variables = {
        n: SimpleNamespace(name=f"my_{n}", start=start, unit=unit)
        for n, (start, unit, _) in starts.items()
    }
    maps = {
        n: [SimpleNamespace(variable=n, factor=factor, offset=0.0)]
        for n, (_, _, factor) in starts.items()
    }
    port = SimpleNamespace(start=maps, settings={}, rating=100.0, V_n=V_n)
    own = SimpleNamespace(
        inner=SimpleNamespace(variables=variables), port=port, _unlike_named=lambda: {}
    )
    return BoundDescription.unlike_delivered(own)


def test_what_fits_is_not_told():
    assert unlike(S_n=(100.0, "MVA", 1.0), v_0=(1.02, "pu", 1.0), P_0=(0.5, "pu", 1.0)) == {}
    assert unlike(20.0, v_0=(20.4, "kV", 20.0), P_0=(60.0, "MW", 100.0)) == {}


@pytest.mark.parametrize(
    ("V_n", "starts", "rating", "words"),
    [
        (None, {"S_n": (40.0, "MVA", 1.0)}, "S_n", "the FMU's my_S_n is 40 MVA by itself"),
        (
            None,
            {"P_0": (60e3, "kW", 100.0)},
            "S_n",
            "my_P_0 is 60000 kW by itself, 600 times as much",
        ),
        (
            20.0,
            {"v_0": (6.6, "kV", 20.0)},
            "V_n",
            "my_v_0 is 6.6 kV by itself, 0.33 times what is bound",
        ),
    ],
)
def test_what_does_not_fit_is_told_of_its_rating(V_n, starts, rating, words):
    found = unlike(V_n, **starts)
    assert list(found) == [rating]
    assert words in found[rating]
