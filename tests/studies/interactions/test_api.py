"""Interactions in Python."""

import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from tests.studies.interactions.park import folder, kept, park


def test_the_face_gives_what_the_command_gives(fmu_path):
    """Systems that a folder keeps are read; a device that is not in the case is swapped where it is asked for."""
    known, case = park().worst_pair, gfor.load(folder() / "park.toml")
    found = case.interactions(folder=kept(), devices={"D": fmu_path("gfl_l2ep")}, places=["east"])
    assert found.worst_pair == known == ("A", "B")
    assert found.stable is True
    assert found.result.stored == 8
    assert found.worst_assignment == {"east": "B"}
    assert found.assignments()["at.east"].tolist() == ["B", "D"]
    assert found.pairs()["unstable_though_stable_alone"].tolist() == [True, False, False]
    shares = found.modes().filter(like="share.")
    assert shares.sum(axis=1).tolist() == pytest.approx([1.0] * len(shares))
    assert repr(found) == "<Interactions of A, B, C in park>"
    assert "worst pair of 3 pairs: A + B" in found._repr_html_()
    assert {path.name for path in found.save(folder() / "saved")} >= {
        "pairs.csv",
        "assignments.csv",
    }


@pytest.mark.parametrize(
    ("wanted", "text"),
    [
        ({"thresold": 0.1}, "cannot be asked for 'thresold'"),
        ({"threshold": 5}, "threshold = 5; it must be a share above 0"),
        ({"bindings": {"D": "a.toml"}}, "bindings: there is no device 'D'; the devices are: none"),
        ({"swap": 1}, "swap"),
        ({"stand_in": 3}, "stand_in"),
    ],
)
def test_wishes_that_mean_nothing_are_refused(wanted, text):
    with pytest.raises(InputError, match=text):
        gfor.load(folder() / "park.toml").interactions(**wanted)
