"""Federates of others, written in plain HELICS: what a user's own program would be. Run as a program with its name."""

import sys
import time

import helics as h

PERIOD = 100e-6
TO_WAIT = "--networktimeout=10s"  # HELICS tries six times: a minute for a broker that starts late


def joined(broker, name="load"):
    info = h.helicsCreateFederateInfo()
    h.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
    h.helicsFederateInfoSetCoreInitString(
        info, f"--federates=1 --broker_address={broker} {TO_WAIT} --loglevel=error"
    )
    h.helicsFederateInfoSetFlagOption(info, h.HELICS_FLAG_UNINTERRUPTIBLE, True)
    return h.helicsCreateValueFederate(name, info)


def gain(
    broker,
    output="load.y",
    subscribed="load.u",
    silent_from=1e9,
    hangs_from=1e9,
    bad_from=1e9,
    deaf=False,
):
    """The output is K·input + offset, with K and offset as gfor gives them.

    A deaf one does not look for the command to leave: it goes on until the broker ends, unhurried.
    """
    federate = joined(broker)
    y = h.helicsFederateRegisterGlobalPublication(federate, output, h.HELICS_DATA_TYPE_DOUBLE, "")
    u = h.helicsFederateRegisterSubscription(federate, subscribed, "")
    start = [
        h.helicsFederateRegisterSubscription(federate, f"load.{name}", "")
        for name in ("K", "offset")
    ]
    h.helicsFederateEnterExecutingMode(federate)
    K, offset = (h.helicsInputGetDouble(value) for value in start)
    h.helicsPublicationPublishDouble(y, K * 1.0 + offset)  # of an input that starts at 1
    step = 0
    while True:
        now = h.helicsFederateRequestTime(federate, step * PERIOD + PERIOD / 2)
        if now >= h.HELICS_TIME_MAXTIME:
            break
        if not deaf and h.helicsFederateGetCommand(federate) == "end":
            break
        value = K * h.helicsInputGetDouble(u) + offset
        if now > hangs_from:
            time.sleep(60)
        if now > bad_from:
            value = float("nan")
            time.sleep(0.05)
        if now < silent_from:
            h.helicsPublicationPublishDouble(y, value)
        step += 1
    h.helicsFederateDisconnect(federate)


KINDS = {
    "gain": {},
    "wrong_output": {"output": "load.z"},
    "wrong_input": {"subscribed": "load.uu"},
    "silent": {"silent_from": 1e-3},
    "hangs": {"hangs_from": 1e-3},
    "nan": {"bad_from": 1e-3, "deaf": True},
}

if __name__ == "__main__":
    try:
        gain(sys.argv[2], **KINDS[sys.argv[1]])
    except h.HelicsException as error:
        sys.exit(f"the federation ended: {error}")
