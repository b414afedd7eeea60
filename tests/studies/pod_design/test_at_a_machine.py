"""A POD at a machine's voltage regulator, tuned as a converter's."""

import json
import re
import shlex

import pytest

GOVERNED = ("--set", "sg1.stabilizer=pod", "--set", "sg*.governor=tgov1")


def test_a_pod_at_a_machine_is_tuned_as_a_converters(gfor, tmp_path):
    """Kundur's inter-area mode by a POD-Q at machine 1: 10 points of damping more, the other modes as they were."""
    file = tmp_path / "pod.toml"
    code, out, error = gfor(
        *("design", "kundur", "--scenario", "thyristor", *GOVERNED, "--component", "sg1"),
        *("--controller", "pod_q", "--no-margins", "--json", "--out", str(file)),
    )
    assert code == 0, error
    found = json.loads(out)
    assert found["target_damping_ratio"] == pytest.approx(0.0, abs=0.002)
    assert found["achieved_damping_ratio"] == pytest.approx(0.1, abs=0.002)
    assert found["stable"]
    other = found["worst_other_mode"]
    assert other["after"]["damping_ratio"] == pytest.approx(
        other["before"]["damping_ratio"], abs=0.001
    )
    assert '"sg1.pod_q.enabled" = true' in file.read_text("utf-8")


def test_growth_that_was_there_before_is_not_the_pods(gfor, tmp_path):
    """Without governors Kundur's machines drift apart at +0.0626 1/s, and with the POD slower; the file's command,
    typed, has the setting and shows the mode that was designed."""
    file = tmp_path / "pod.toml"
    own = ("--set", "sg1.stabilizer=pod", "--set", "sg1.pod_q.limit=0.15")
    code, out, error = gfor(
        *("design", "kundur", "--scenario", "thyristor", *own, "--set", "*.pod_q.K=7"),
        *("--component", "sg1", "--controller", "pod_q", "--no-margins", "--out", str(file)),
    )
    assert code == 3, error
    text = " ".join(out.split())
    assert "the system is UNSTABLE, as it is without the controller: the eigenvalue at" in text
    assert re.search(
        r"grows slower than without it, \+0\.0625\d 1/s there; no gain from 0 to 400", text
    )
    (typed,) = re.findall(r"use it with: gfor (.*)$", out, re.MULTILINE)
    words = shlex.split(typed)
    assert "sg1.stabilizer=pod" in words
    _, out, error = gfor(*words, "--json")
    (scenario,) = json.loads(out)["scenarios"]
    (mode,) = [mode for mode in scenario["modes"] if mode["name"] == "inter-area"]
    achieved = json.loads(file.with_suffix(".json").read_text("utf-8"))["achieved_mode"]
    assert mode["real"] == pytest.approx(achieved["real"], abs=1e-6)


def test_a_sign_that_asks_for_less_lead_is_told_as_it_is_typed(gfor, tmp_path):
    file = tmp_path / "pod.toml"
    command = ("design", "kundur", "--scenario", "thyristor", *GOVERNED, "--component", "sg1")
    command += ("--controller", "pod_q", "--stages", "1", "--no-margins", "--out", str(file))
    code, _, error = gfor(*command, "--set", "sg1.pod_q.sign=-1")
    assert code == 1
    (typed,) = re.findall(r"turns by 26° instead of 154°: add (.*)$", error, re.MULTILINE)
    code, _, error = gfor(*command, *shlex.split(typed))
    assert code == 0, error
