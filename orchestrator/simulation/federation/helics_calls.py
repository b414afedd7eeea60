"""The calls of HELICS that both the hub and a federate of ours make."""

import json
import time
from contextlib import suppress
from functools import cache
from types import ModuleType
from typing import Any

from fmus.toolchain.extras import require
from orchestrator.core.options import Option
from orchestrator.simulation.federation.choice import address_of

# HELICS's own default, and the only core of its packages that always works between machines
CORE = "zmq"
_TRIES = 2  # before the last try to join a broker
_PAUSE = 0.5  # between two tries [s]
FAULT_MARK = "fault"
OURS_MARK = "gfor-cosim"
"""Texts that a federate publishes as ``component/fault`` and ``component/gfor-cosim``."""


@cache
def library() -> ModuleType:
    """The package; it takes half a second to import, so only the processes of a federation do."""
    require(Option.ENGINE_HELICS, "helics")
    import helics  # noqa: PLC0415 - of the extra `federation`, and slow to import

    module: ModuleType = helics
    return module


def join(name: str, broker: str, seconds: float) -> Any:
    """A federate at a broker.

    Raises a `helics.HelicsException` if the broker does not answer within the time [s], or the name is taken. On a busy
    machine HELICS gives up before the time is over, and is asked again."""
    helics, end = library(), time.monotonic() + seconds
    for _ in range(_TRIES):
        with suppress(helics.HelicsException):
            return _joined(helics, name, broker, end - time.monotonic())
        time.sleep(_PAUSE)
        if time.monotonic() > end:
            break
    return _joined(helics, name, broker, end - time.monotonic())


def _joined(helics: ModuleType, name: str, broker: str, seconds: float) -> Any:
    host, port = address_of(broker)
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(info, CORE)
    wait = f"{max(1, round(1000 * seconds))}ms"
    helics.helicsFederateInfoSetCoreInitString(
        info,
        f"--federates=1 --broker_address=tcp://{host}:{port} --timeout={wait} --loglevel=error",
    )
    helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
    return helics.helicsCreateValueFederate(name, info)


def text_of(error: Exception) -> str:
    return str(error).partition("] ")[2] or str(error)


def ask(federate: Any, target: str, query: str) -> Any:
    helics = library()
    answer = helics.helicsQueryExecute(helics.helicsCreateQuery(target, query), federate)
    if isinstance(answer, str):
        try:
            return json.loads(answer)
        except ValueError:
            return answer
    return answer


def optional_subscription(federate: Any, name: str, unit: str) -> Any:
    helics = library()
    handle = helics.helicsFederateRegisterSubscription(federate, name, unit)
    helics.helicsInputSetOption(handle, helics.HELICS_HANDLE_OPTION_CONNECTION_OPTIONAL, 1)
    return handle


def publication(federate: Any, name: str, unit: str) -> Any:
    helics = library()
    return helics.helicsFederateRegisterGlobalPublication(
        federate, name, helics.HELICS_DATA_TYPE_DOUBLE, unit
    )


def text_publication(federate: Any, name: str) -> Any:
    helics = library()
    return helics.helicsFederateRegisterGlobalPublication(
        federate, name, helics.HELICS_DATA_TYPE_STRING, ""
    )
