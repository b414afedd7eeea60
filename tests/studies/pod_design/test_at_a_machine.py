"""A POD at a machine's voltage regulator, tuned as a converter's."""

import json

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
