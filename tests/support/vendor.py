"""A vendor's device as it is delivered: volts in kV, power in kW, its own rated frequency, no state to save."""

from pathlib import Path

from orchestrator.cases.built_in import infinite_bus
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

RATING, V_N = 1500.0, 20.0
"""[MVA], and [kV] line to line."""

BINDING = """\
[rating]
S_n = "{rating} MVA"
V_n = "{v_n} kV"
f_n = "{f_n} Hz"
I_max = {i_max}
[voltage]
form = "rectangular"
variables = ["v_re", "v_im"]
value = "phase peak"
[current]
form = "rectangular"
variables = ["i_re", "i_im"]
value = "peak"
direction = "{direction}"
[start]
P_0 = {{ variable = "P_0" }}
Q_0 = {{ variable = "Q_0" }}
v_0 = {{ variable = "v_0", value = "phase peak" }}
theta_0 = {{ variable = "theta_0" }}
"""
SHOWN = '[signals.omega]\nvariable = "f_meas"\n'


def device(folder: Path, made_for: float = 50.0, **defines) -> Path:
    """The FMU; it measures the network's frequency in Hz."""
    macros = {
        "RATING": RATING,
        "V_UNIT": repr(V_N * (2 / 3) ** 0.5),
        "P_UNIT": repr(1000 * RATING),
        "NOMINAL": made_for,
        "I_UNIT": repr(RATING / V_N / 3**0.5 * 2**0.5),
        "OMEGA_UNIT": made_for,
    }
    watt = {"kg": "1", "m": "2", "s": "-3", "factor": "1000"}
    source = converter(
        "vendor",
        units=("kV", "kA", "kW"),
        state=False,
        omega=("f_meas", "Hz"),
        **(macros | defines),
    )
    return build(type(source)(**{**vars(source), "units": {"kW": watt, "kvar": watt}}), folder)


def binding(
    folder: Path,
    f_n: float = 50.0,
    v_n: float = V_N,
    rating: float = RATING,
    direction: str = "into the grid",
    i_max: float = 1.5,
    signals: str = SHOWN,
) -> Path:
    """Its binding, right unless something is given."""
    path = folder / "vendor.toml"
    text = (
        BINDING.format(rating=rating, v_n=v_n, f_n=f_n, direction=direction, i_max=i_max) + signals
    )
    path.write_text(text, encoding="utf-8")
    return path


def case(folder: Path, f_n: float = 50.0, changed: str = "", depth: float = 0.2) -> Path:
    """The device at an infinite bus that dips."""
    text = (Path(infinite_bus.__file__).parent / "case.toml").read_text(encoding="utf-8")
    text = text.replace(
        'model = "gfor"\n', f'fmu = "vendor.fmu"\nbinding = "vendor.toml"\n{changed}'
    )
    text = text.replace(
        "parameters = { P_0 = 9.0,", f'parameters = {{ f_n = "{f_n} Hz", P_0 = 9.0,'
    )
    text = text.replace('stop_time = "5 s"', 'stop_time = "2 s"').partition(
        "[scenarios.load_step]"
    )[0]
    text = text.replace("value = 0.2\n", f"value = {depth}\n")
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path
