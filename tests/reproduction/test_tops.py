"""TOPS itself on the system k2a_val, in an environment of its own: what the page k2a says of it, and our equations.

The other tests know TOPS' figures from the page alone; here TOPS computes them again.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.reference.short_circuit import ShortCircuit
from tests.reference.tops_systems import tops_system
from tests.reproduction.test_short_circuits import MICRO, SPEEDS, assert_modes, row, wanted_modes
from tests.support.scenarios import prepare_one

pytestmark = [pytest.mark.reproduction, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
PYTHON = Path(os.environ.get("GFOR_TOPS_PYTHON", ROOT / ".venv-tops" / "bin" / "python"))
"""TOPS pins NumPy and pandas to others than ours."""


def numbers(pairs):
    return np.array([complex(*pair) for pair in pairs])


def test_tops_has_the_cases_power_flow_and_the_pages_errors_and_modes():
    """In one test, so that TOPS computes once."""
    if not PYTHON.exists():
        pytest.skip(
            "TOPS has no environment: python3 -m venv .venv-tops && .venv-tops/bin/pip install tops==0.3.0; or name "
            "its Python in GFOR_TOPS_PYTHON"
        )
    command = [str(PYTHON), "-m", "tests.benchmarks.tops_peers", "k2a"]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {
        "OPENBLAS_NUM_THREADS": "1"
    }
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    tops = json.loads(done.stdout)
    assert tops["tops"] == "0.3.0"

    ready = prepare_one("k2a", "pss")
    theirs = numbers(tops["voltages"])
    ours = np.array([ready.power_flow.voltages[f"bus_{k + 1}"] for k in range(len(theirs))])
    ours *= np.exp(1j * (np.angle(theirs[0]) - np.angle(ours[0])))
    assert np.abs(ours - theirs).max() < 1e-6

    assert tops["errors"] == pytest.approx(row("k2a", SPEEDS, "TOPS 0.3.0"), abs=MICRO)
    for scenario in ("pss", "no_pss"):
        theirs = numbers(tops[scenario])
        assert_modes(theirs, wanted_modes("k2a", f"{scenario} | TOPS 0.3.0"))
        equations = ShortCircuit(
            tops_system("k2a"), "tops", stabilisers=scenario == "pss"
        ).eigenvalues()
        swings = [z for z in theirs if z.imag > 2.2 and -z.real < 0.4 * abs(z)]
        assert len(swings) >= 3
        assert max(np.abs(equations - z).min() for z in swings) < 1e-4
