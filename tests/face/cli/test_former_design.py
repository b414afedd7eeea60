"""``gfor design`` beside a parameter file of another question: nothing is lost without a word."""

import pytest

from orchestrator.cases.form.parameter_files import parameter_file_text
from orchestrator.face.cli.former_design import former_design, place_of_design

MADE = "gfor design five --controller pod_p"
OUTCOME = "with it: -1.04 ± j7.86 rad/s (1.250 Hz, 13.11 %); required: 13.11 % (met)"


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "five_pod_p.toml"
    comments = [
        "POD-P for five",
        f"command: {MADE}",
        "scenario gfor, mode slow",
        OUTCOME,
        "K in pu",
    ]
    file.write_text(parameter_file_text({"gfor.pod_p.K": 54.8}, comments), "utf-8")
    return file


def test_a_design_that_is_not_met_leaves_another_one(path, capsys):
    place = place_of_design(path, f"{MADE} --gain-bounds 200:400", met=False, named=False)
    assert place == path.with_name("five_pod_p_not_met.toml")
    said = " ".join(capsys.readouterr().err.split())
    assert f"stays as it was, with another design, `{MADE}`: {OUTCOME}" in said
    assert said.endswith("five_pod_p_not_met.toml")


@pytest.mark.parametrize(("met", "named"), [(True, False), (False, True)])
def test_a_design_that_replaces_another_one_says_what_it_had(path, capsys, met, named):
    assert place_of_design(path, f"{MADE} --damping 20%", met=met, named=named) == path
    said = " ".join(capsys.readouterr().err.split())
    assert f"held another design, `{MADE}`: {OUTCOME}: it is replaced" in said


def test_one_that_is_not_met_is_told_where_it_is_replaced(path, capsys):
    beside = path.with_name("five_pod_p_not_met.toml")
    beside.write_text('[set]\n"gfor.pod_p.K" = 3.0\n', "utf-8")
    assert place_of_design(path, f"{MADE} --damping 90%", met=False, named=False) == beside
    said = " ".join(capsys.readouterr().err.split())
    assert "five_pod_p_not_met.toml held other parameters: it is replaced" in said


@pytest.mark.parametrize("met", [True, False])
def test_the_same_command_again_says_nothing(path, capsys, met):
    assert place_of_design(path, MADE, met=met, named=False) == path
    assert (
        place_of_design(path.with_name("new.toml"), MADE, met=met, named=False).name == "new.toml"
    )
    assert capsys.readouterr().err == ""


def test_a_design_over_points_tells_its_verdict(path):
    verdict = "met: all 12 points have 5 % or more"
    path.write_text(parameter_file_text({}, ["PODs", f"command: {MADE}", verdict, "K"]), "utf-8")
    assert former_design(path, "").outcome == verdict


def test_what_a_file_says_of_itself_steers_no_terminal(path, capsys):
    path.write_text(path.read_text("utf-8").replace("(met)", "\x1b[2K(met)"), "utf-8")
    place_of_design(path, f"{MADE} --damping 20%", met=True, named=False)
    said = capsys.readouterr().err
    assert "held another design" in said
    assert "\x1b" not in said
