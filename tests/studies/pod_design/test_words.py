"""What the first sentence on a design says beside the target."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.pod_design.sheet import verdict

REST = "; least damped of all then 8.71 % at 1.527 Hz"


@pytest.mark.parametrize(
    ("other", "met", "broken", "said"),
    [
        (0.0871, True, None, REST),
        (0.0871, False, "it harms another", "; but it harms another"),
        (0.12, True, None, ""),
        (None, True, None, ""),
    ],
)
def test_a_mode_below_what_is_asked_is_told_with_met(other, met, broken, said):
    worst = None if other is None else SimpleNamespace(damping_ratio=other, frequency_hz=1.527)
    design = SimpleNamespace(
        achieved_damping=0.1044,
        required_damping=0.1,
        after=SimpleNamespace(other_named=None),
        broken=broken,
        met=met,
        worst_other=worst,
        damping_met=True,
        spoilt=None,
        thin_margin=None,
        refinement=None,
        gain_is_swept=False,
        final=None,
        designed=None,
        active_bound=None,
    )
    assert verdict(design) == f"the target has 10.44 % of damping, 10.00 % are required{said}"
