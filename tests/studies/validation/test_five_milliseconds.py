"""Samples 5 ms apart, whose times are off by their last bit, leave the moment of a jump in doubt."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from orchestrator.studies.validation.event import JumpDoubt
from tests.studies.validation.made_device import RATING, model, recorded, validated

LONG_STEP = 1e-3  # communication step [s], of which a jump is seen late by what matters


@pytest.mark.parametrize(
    ("interval", "doubt"), [(0.004, JumpDoubt.STEP), (0.005, JumpDoubt.SAMPLES)]
)
def test_samples_of_5_ms_leave_the_moment_of_a_jump_open_as_a_file_writes_them(interval, doubt):
    frame = recorded().to_dataframe()
    frame.index = pd.Index(np.round(interval * np.arange(len(frame)), 6), name="time")
    assert (np.median(np.diff(frame.index)) < interval) == (doubt is JumpDoubt.SAMPLES)
    device = replace(model(S_n=RATING), step_size=LONG_STEP)
    (comparison,) = validated(device, frame.to_xarray()).result.comparisons
    assert comparison.doubt is doubt
