"""The converter with its POD controllers' measurement as an input, so that it can come late, or from elsewhere."""

from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import declare_port_outputs, device_port
from gfor_fmu.converter import P_0, S_N, declare_converter, declare_converter_outputs
from gfor_fmu.usual_ranges import FORMING


def grid_forming_converter_pod_input() -> Model:
    """`grid_forming_converter`, but POD-P and POD-Q act on the frequency at the input ``omega_pod``."""
    title = (
        "Grid-forming converter with P-f and Q-V droop; POD-P and POD-Q act on an input (EMT type)"
    )
    m = ModelBuilder("gfor_pod_input", title, kind="converter", usual=FORMING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    measured = m.input(
        "omega_pod", "pu", "Frequency that the POD controllers act on", base="f_n", start=1.0
    )
    converter = declare_converter(m, port, measured)
    declare_port_outputs(m, port, converter.current)
    declare_converter_outputs(m, converter)
    return m.build()
