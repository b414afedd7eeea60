"""The forms that a component of a case may have: a model of the catalogue, an FMU, a vendor's DLL, or a scan."""

from orchestrator.cases.form.schema import ComponentTable

NO_STATES = (
    "{0} is known by its scan alone, which has no states: it cannot be run and has no modes; `gfor fmu "
    "nyquist {1}` judges it, and for all else give the vendor's 'fmu' or 'dll'"
)


def contradiction(table: ComponentTable) -> str:
    if sum(given is not None for given in (table.model, table.fmu, table.dll, table.scan)) != 1:
        return (
            "give either 'model' (a model of the catalogue), 'fmu' (the path of an .fmu), 'dll' (of a vendor's DLL, or "
            "of the file that lays a circuit around one) or 'scan' (of a device that is known by its admittance)"
        )
    if table.binding is not None and table.file is None:
        return "'binding' is for an FMU of others; give its path as 'fmu', or remove 'binding'"
    if table.voltage is not None and table.scan is None:
        return "'voltage' is the rated one of a scan in siemens; remove it, or give 'scan'"
    return ""
