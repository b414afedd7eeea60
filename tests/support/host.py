"""One FMU instance as a host sees it, through FMPy."""

import math

import fmpy
import numpy as np
from fmpy import calloc, free
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

H = 1e-4
OK, WARNING, DISCARD, ERROR = range(4)
GENERATOR = "synchronous_generator_st1"


class Host:
    """One instance through FMPy, with everything it logged."""

    def __init__(self, directory, instance="one"):
        md = fmpy.read_model_description(str(directory), validate=False)
        self.md = md
        self.vr = {v.name: v.valueReference for v in md.modelVariables}
        self.reals = [v.name for v in md.modelVariables if v.type == "Real"]
        self.log = []
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.log.append(a[-1].decode()))
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        identifier = md.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=md.guid,
            unzipDirectory=str(directory),
            modelIdentifier=identifier,
            instanceName=instance,
        )
        self.fmu.instantiate(callbacks=self._callbacks, loggingOn=True)

    def initialise(self):
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def status(self, function, *arguments):
        """Status of a call that may be refused."""
        try:
            function(*arguments)
        except FMICallException as error:
            return error.status
        return OK

    def step(self, time=0.0, size=H):
        return self.status(self.fmu.doStep, time, size)

    def set(self, **values):
        self.fmu.setReal(
            [self.vr[name.replace("__", ".")] for name in values], list(values.values())
        )

    def get(self, *names):
        values = self.fmu.getReal([self.vr[name] for name in names])
        return values[0] if len(names) == 1 else values

    def everything(self):
        """Every Real as bits, so that NaN and −0 count."""
        return np.array(self.get(*self.reals)).tobytes()

    def run(self, steps=50, first=0):
        """Drive with varying inputs; every Real after every step."""
        inputs = [v.name for v in self.md.modelVariables if v.causality == "input"]
        rows = []
        for k in range(first, first + steps):
            self.fmu.setReal(
                [self.vr[n] for n in inputs], [drive(k, j) for j in range(len(inputs))]
            )
            assert self.step(k * H) == OK, self.log
            rows.append(self.everything())
        return rows

    def close(self):
        if self.fmu is not None:
            self.fmu.freeInstance()
        self.fmu = None


def drive(step, channel):
    return (1.0 if channel == 0 else 0.0) + 0.03 * math.sin(0.05 * step + channel)


def running(h):
    """A converter with POD-P after 50 steps."""
    h.initialise()
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [True])
    h.set(pod_p__K=50.0)
    h.run(50)
    return h
