"""Recognition of FMUs that stand at a bus: a vendor's controller alone does not."""

from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.description import FmuDescription, read_declared
from orchestrator.devices.fmi.vendor_files import as_fmu, is_vendor_file

PORT = ("v_re", "v_im", "i_re", "i_im")  # inputs and outputs of our port

NO_BUS = (
    "a controller alone stands at no bus. Lay a circuit around it with a device's file and give that instead "
    "(fmus/vendor_dll/README.md)"
)


def is_controller_alone(description: FmuDescription) -> bool:
    """Return whether an FMU was made of a vendor's DLL and has no port of ours."""
    return bool(description.kept_in) and any(name not in description.variables for name in PORT)


def as_device(path: Path, binding: Path | None) -> Path:
    """The FMU of what is to stand at a bus: of an FMU, of a DLL, or of a device's file."""
    found = as_fmu(path)
    if binding is None and is_vendor_file(path) and is_controller_alone(read_declared(found)):
        raise InputError(f"{path}: it has no {', '.join(PORT)}: {NO_BUS}")
    return found
