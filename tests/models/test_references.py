"""Every FMU reproduces its folder's reference trajectory under FMPy, somebody else's importer."""

import csv
from functools import lru_cache

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from tests.support.make_references import REFERENCES
from tests.support.variable_table import LEAFLETS, section

STEP = 1e-4
# Internal step [s] → error in parts of each signal's range, from 10 ms after the jump on. The converter's fastest
# oscillating modes are near 4300 rad/s: Runge-Kutta of order 4 errs by (0.43)⁵/120 ≈ 1e-4 there, and 4⁴ = 256
# times less at a quarter of the step.
LATER = {1e-4: 2e-4, 2.5e-5: 2e-6}


@pytest.mark.parametrize("internal_step", LATER)
@pytest.mark.parametrize("reference", REFERENCES, ids=lambda r: r.model)
def test_fmu_reproduces_its_reference_trajectory(reference, internal_step, fmu_path):
    with reference.path.open() as file:
        columns = next(csv.reader(file))
    rows = np.loadtxt(reference.path, delimiter=",", skiprows=1)
    found = simulate(fmu_path(reference.model), reference, columns, rows, internal_step)
    wanted = rows[:, -len(reference.outputs) :]
    scale = np.maximum(1e-3, np.ptp(wanted, axis=0))
    error = np.abs(found - wanted) / scale
    jump = next(
        k for k in range(1, len(rows)) if not np.array_equal(rows[k, 1:3], rows[k - 1, 1:3])
    )
    # the steady state, and the grid's settling to its first currents
    assert error[:jump].max() < 5e-8
    assert error[jump + 5 :].max() < LATER[internal_step]


@lru_cache(maxsize=4)
def opened(path):
    """An FMU's description and the folder with its files, for all that is simulated with it."""
    return read_model_description(str(path)), extract(str(path))


def simulate(path, reference, columns, rows, internal_step):
    """A plain co-simulation loop with held inputs: set, read what follows directly, step."""
    description, folder = opened(path)
    references = {v.name: v.valueReference for v in description.modelVariables}
    types = {v.name: v.type for v in description.modelVariables}
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=reference.model,
    )
    inputs = columns[1 : -len(reference.outputs)]
    input_references = [references[n] for n in inputs]
    output_references = [references[n] for n in reference.outputs]
    fmu.instantiate()
    try:
        for name, value in reference.parameters.items():
            if types[name] == "Boolean":
                fmu.setBoolean([references[name]], [bool(value)])
            else:
                fmu.setReal([references[name]], [value])
        fmu.setReal([references["internal_step"]], [internal_step])
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.setReal(input_references, rows[0, 1 : 1 + len(inputs)].tolist())
        fmu.exitInitializationMode()
        found, per_row = [], round((rows[1, 0] - rows[0, 0]) / STEP)
        for k, row in enumerate(rows):
            fmu.setReal(input_references, row[1 : 1 + len(inputs)].tolist())
            found.append(fmu.getReal(output_references))
            for i in range(per_row):
                fmu.doStep((k * per_row + i) * STEP, STEP)
        fmu.terminate()
    finally:
        fmu.freeInstance()
    return np.array(found)


@pytest.mark.parametrize("name", LEAFLETS)
def test_leaflet_shows_every_variable_as_the_model_declares_it(name):
    assert section(name) in LEAFLETS[name].read_text(encoding="utf-8")
