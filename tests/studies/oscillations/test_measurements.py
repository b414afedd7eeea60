"""What of a record is used."""

import numpy as np

from orchestrator.studies.oscillations.measurements import _longest_stretch


def test_of_a_record_with_a_long_gap_the_longest_part_is_used_as_a_whole():
    parts, said = (np.arange(0, 1, 0.02), np.arange(20, 30.001, 0.02), np.arange(50, 51, 0.02)), []
    times, _ = _longest_stretch(np.concatenate(parts), [], said)
    np.testing.assert_allclose(times, parts[1], atol=1e-9)
    assert said == ["rows are missing: only the part from 20 to 30 s is used"]
