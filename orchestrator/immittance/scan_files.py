"""Files of scans, of either form."""

from pathlib import Path

from orchestrator.errors import InputError
from orchestrator.immittance.imtb import is_imtb, read_imtb
from orchestrator.immittance.scan import Scan
from orchestrator.immittance.ztool import is_ztool, read_ztool

ENDINGS = (".txt", ".csv")
_LARGEST = 200e6


def read_scan(path: Path, rated_hz: float, *, network: bool = False) -> Scan:
    """A scan from a file of Z-tool's or IMTB's form.

    ``network``: Which part of a file is meant that holds a device and a network."""
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path}: a scan of more than 200 MB is not read")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}; give the path of a scan") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: it is not a text file; a scan is one of Z-tool's or IMTB's") from error
    first = text.partition("\n")[0].strip()
    if is_ztool(first):
        return read_ztool(path, text, rated_hz)
    if is_imtb(first):
        return read_imtb(path, text, rated_hz, network=network)
    raise InputError(
        f"{path}: its first line {first[:60]!r} is of no known form of scans; Z-tool's begins 'f<tab>BUS-1_d<tab>"
        "BUS-1_q', IMTB's 'f,Zdut_dq_11_re,Zdut_dq_11_im'"
    )
