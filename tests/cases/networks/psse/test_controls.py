"""Controls of taps and switched shunts, as each revision of RAW has their columns."""

import pytest

from tests.cases.networks.psse import raw, read_text, records

RATES = {33: "0,0,0", 34: ",".join(["0"] * 12), 35: ",".join(["0"] * 12)}
NODE = {33: "", 34: "", 35: "0,"}


def winding(revision, control="5", code=1, rest="0,0,0,0"):
    ends = f"{code},{control},{NODE[revision]}1.1,0.9,1.02,0.98,5,{rest}"
    return f"1.0,0,0,{RATES[revision]},{ends}"


SHUNTS = {
    33: "5,1,0,1,1.03,0.97,0,100,'',10.0,2,10.0,1,-20.0",
    34: "5,1,0,1,1.03,0.97,0,100,'',10.0,2,10.0,1,-20.0",
    35: "5,'1 ',1,0,1,1.03,0.97,0,0,100,'',10.0,1,2,10.0,0,3,7.0,1,1,-20.0",
}


@pytest.fixture
def read(tmp_path):
    def read(revision, line=None, shunt=None, first=None):
        found = records(revision)
        if line:
            found["TRANSFORMER"][6] = line
        if first:
            found["TRANSFORMER"][4:6] = first
        found["SWITCHED SHUNT"] += [shunt] if shunt else []
        return read_text(tmp_path, raw(revision, found))

    return read


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_each_revision_has_its_columns(read, revision):
    found = read(revision, winding(revision), SHUNTS[revision])
    (tap,), (shunt,) = found.taps.values(), found.shunts
    assert (tap.bus, tap.least, tap.most, tap.raises) == (5, 0.98, 1.02, False)
    assert tap.positions == pytest.approx((0.9, 0.95, 1.0, 1.05, 1.1))
    assert (shunt.place, shunt.bus, shunt.least, shunt.most) == (5, 5, 0.97, 1.03)
    assert (shunt.initial, shunt.positions) == (10.0, (-20.0, 0.0, 10.0, 20.0))


@pytest.mark.parametrize(("control", "raises"), [(7, True), (2, False), (-5, True), (5, False)])
def test_the_side_of_the_bus_tells_which_way_the_tap_goes(read, control, raises):
    """The transformer is from bus 7 to bus 2; a sign tells the side of a bus that is not its own."""
    (tap,) = read(33, winding(33, str(control))).taps.values()
    assert tap.raises == raises


@pytest.mark.parametrize(
    "line",
    [
        winding(33, code=0),
        winding(33, code=-1),
        winding(33, code=2),
        winding(33, code=3),
        winding(33, control="0"),
        winding(33, control="77"),
        winding(33, rest="0,0,0.1,0"),
    ],
)
def test_other_taps_are_held(read, line):
    assert not read(33, line).taps


def test_ratios_in_kilovolts_are_positions_too(read):
    """CW = 2: bus 7 has 230 kV."""
    line = "230.0,0,0,0,0,0,1,5,253,207,1.02,0.98,3,0,0,0,0"
    first = ["7,2,0,'1 ',2,1,1,0,0,2,'T 2',1,1,1", "0,0.0625,100"]
    found = records(33)["TRANSFORMER"]
    assert found[4].startswith("7,2,")
    (tap,) = read(33, line, first=first).taps.values()
    ratio = tap.positions[1]
    assert [x / ratio for x in tap.positions] == pytest.approx([0.9, 1.0, 1.1])


@pytest.mark.parametrize(
    "shunt",
    [
        "5,0,0,1,1.03,0.97,0,100,'',10.0,2,10.0",
        "5,2,0,1,1.03,0.97,0,100,'',10.0,2,10.0",
        "5,1,1,1,1.03,0.97,0,100,'',10.0,2,10.0",
        "5,1,0,0,1.03,0.97,0,100,'',10.0,2,10.0",
        "5,1,0,1,1.03,0.97,0,100,'',10.0",
    ],
)
def test_other_shunts_are_held(read, shunt):
    assert not read(33, shunt=shunt).shunts
