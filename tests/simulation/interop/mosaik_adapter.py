"""FMUs as simulators of mosaik, which brings none: its API asks for step(time, inputs) and get_data()."""

import shutil

import mosaik_api_v3
from drivers import TABLE
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave


class Adapter(mosaik_api_v3.Simulator):
    """One FMU; its step at mosaik's time k goes from k to k + 1."""

    def __init__(self):
        super().__init__({"type": "time-based", "models": {}, "extra_methods": ["outputs"]})

    def init(self, sid, time_resolution, path, name, parameters):
        self._H = time_resolution
        description = read_model_description(path)
        self._variables = {v.name: v for v in description.modelVariables}
        self._folder = extract(path)
        self._fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self._fmu.instantiate()
        for parameter, value in parameters.items():
            variable = self._variables[parameter]
            setter = self._fmu.setBoolean if variable.type == "Boolean" else self._fmu.setReal
            setter([variable.valueReference], [value])
        self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        inputs = [v.name for v in description.modelVariables if v.causality == "input"]
        self._outputs = [v.name for v in description.modelVariables if v.causality == "output"]
        self.meta["models"]["Unit"] = {
            "public": True,
            "params": [],
            "attrs": [*inputs, *self._outputs],
        }
        return self.meta

    def create(self, num, model):
        return [{"eid": "unit", "type": model}]

    def outputs(self):
        values = self._fmu.getReal([self._variables[name].valueReference for name in self._outputs])
        return dict(zip(self._outputs, values, strict=True))

    def step(self, time, inputs, max_advance):
        for name, sources in inputs.get("unit", {}).items():
            (value,) = sources.values()
            self._fmu.setReal([self._variables[name].valueReference], [value])
        self._fmu.doStep(time * self._H, self._H)
        return time + 1

    def get_data(self, outputs):
        known = self.outputs()
        return {entity: {name: known[name] for name in names} for entity, names in outputs.items()}

    def finalize(self):
        self._fmu.terminate()
        self._fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


class Rows(mosaik_api_v3.Simulator):
    """Keeps what it receives, one row a step."""

    def __init__(self):
        super().__init__({"type": "time-based", "models": {}})

    def init(self, sid, time_resolution, record):
        self._record = record
        self.meta["models"]["Table"] = {"public": True, "params": [], "attrs": record}
        return self.meta

    def create(self, num, model):
        return [{"eid": "table", "type": model}]

    def step(self, time, inputs, max_advance):
        received = inputs["table"]
        TABLE.append([time, [next(iter(received[name].values())) for name in self._record]])
        return time + 1

    def get_data(self, outputs):
        return {}
