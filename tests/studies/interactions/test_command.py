"""``gfor interactions`` from its words to its files, and the figures of its guide."""

import json
import re

import pytest

from tests.studies.interactions.park import GUIDE, folder, park, studied

pytestmark = pytest.mark.usefixtures("undrawn")

MINUS = str.maketrans("−", "-")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def test_words_files_and_what_is_kept(gfor, results):
    options = ("interactions", folder() / "park.toml", "--workers", 1, "--out", results)
    code, said, _ = gfor(*options)
    assert code == 0
    assert "stable: the largest real part of all 79 eigenvalues" in said
    assert "worst pair of 3 pairs: A + B: UNSTABLE together, though stable alone" in said
    assert "static_generation stands in for the vendors" in said
    assert {path.name for path in results.iterdir() if path.is_file()} >= {
        "modes.csv",
        "pairs.csv",
        "interactions.json",
        "interactions.html",
    }
    page = (results / "interactions.html").read_text(encoding="utf-8")
    assert page.count("<rect") == 9
    assert "A, B: UNSTABLE, -9.50 %" in page
    code, said, _ = gfor(*options, "--json", "--fail-unstable")
    assert code == 1  # the pair A + B grows
    found = json.loads(said)
    assert found == park().as_json()
    assert found == json.loads((results / "interactions.json").read_text(encoding="utf-8"))
    assert found["worst_pair"] == ["A", "B"]
    assert [
        sum(mode["groups"].values()) for mode in found["as_in_the_case"]["modes"]
    ] == pytest.approx([1.0] * 7)
    _, said, _ = gfor(*options)
    assert "0 systems computed, 8 were there already" in said


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            ("--place", "east"),
            "--place says where devices are swapped; give --swap or a --device as well",
        ),
        (("--binding", "a.toml"), "--binding is of a --device"),
        (("--scenario", "a", "--scenario", "b"), "gfor interactions is for one scenario"),
        (("--device", "none.fmu"), "none.fmu"),
        (("--threshold", "0.05"), "'0.05' is read in percent; write 5 for a ratio of 0.05"),
    ],
)
def test_what_cannot_be_asked_is_refused(options, text, gfor, results):
    code, _, said = gfor("interactions", folder() / "park.toml", "--out", results, *options)
    assert code == 2
    assert text in " ".join(said.split())
    assert "Traceback" not in said


# -- the guide ---------------------------------------------------------------------------------


def rows(first):
    """Cells of the guide's table whose head begins so."""
    text = GUIDE.read_text(encoding="utf-8").translate(MINUS).replace("**", "")
    table = text[text.index(f"| {first} |") :].partition("\n\n")[0]
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]
    ]


def test_the_guides_modes_are_those_that_are_computed():
    table = rows("Mode [rad/s]")
    for row, judged in zip(table, park().judgement.modes, strict=False):
        mode = judged.mode
        assert row[0] == f"{mode.real:.2f} ± j{mode.imag:.2f}"
        assert row[1:3] == [f"{mode.frequency_hz:.2f}", f"{mode.damping_percent:.2f}"]
        assert row[3:7] == [
            f"{100 * judged.groups.get(group, 0):.0f} %" for group in ("A", "B", "C", "grid")
        ]
        assert row[7] == (", ".join(judged.vendors) if judged.is_interaction else "")
    others = park().judgement.modes[len(table) :]
    assert len(others) == 4
    assert min(judged.mode.damping_percent for judged in others) > 70


def test_the_guides_pairs_are_those_that_are_computed():
    judgement = park().judgement
    by_name = {"no vendor": judgement.none}
    by_name |= {f"{vendor} alone": system for vendor, system in judgement.alone.items()}
    by_name |= {pair.text: pair.joint for pair in judgement.pairs}
    table = rows("System")
    assert [row[0] for row in table] == [*by_name]
    for name, verdict, damping, where, of_all, mode_of_all in table:
        system = by_name[name]
        assert verdict == {True: "stable", False: "UNSTABLE"}[system.stable]
        assert damping == ("none" if system.critical is None else f"{system.least_damping:.2f}")
        assert where == (
            "" if system.critical is None else f"{system.critical.frequency_hz:.4g} Hz"
        )
        least = system.least_of_all
        wanted = ("none", "") if least is None else (least.damping_percent, least.frequency_hz)
        assert of_all == (wanted[0] if least is None else f"{wanted[0]:.2f}")
        assert mode_of_all == (wanted[1] if least is None else f"{wanted[1]:.4g} Hz")


def test_the_guides_followed_modes_are_those_that_are_computed():
    pairs, table = park().judgement.pairs, rows("Pair")
    assert [row[0] for row in table] == [pair.text for pair in pairs]
    for pair, row in zip(pairs, table, strict=True):
        mode = pair.mode
        assert row[1] == f"{mode.together.frequency_hz:.4g} Hz"
        dampings = (mode.neither_percent, *mode.alone_percent, mode.together.damping_percent)
        assert row[2:6] == ["not followed" if x is None else f"{x:.2f}" for x in dampings]
        assert row[6] == f"{pair.fall:+.2f}"


@pytest.mark.slow
def test_the_guides_words_on_the_swap_are_right():
    text = GUIDE.read_text(encoding="utf-8")
    assert re.search(
        r"27 assignments,.*Seven are unstable; the worst is B everywhere", text, re.DOTALL
    )
    found = studied(swap=True).judgement.assignments
    assert (len(found), sum(one.stable is False for one in found)) == (27, 7)
    assert found[0].name.names == ("B", "B", "B")
