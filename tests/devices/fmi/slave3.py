"""What pythonfmu3 makes an FMU of FMI 3.0 of; it is imported by nothing else."""

from pythonfmu3 import Boolean, Float64, Fmi3Causality, Fmi3Slave, Int32


class Lag3(Fmi3Slave):
    author = "tests"
    description = "First-order lag"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.u = 0.0
        self.y = 0.0
        self.T = 0.5
        self.order = 1
        self.active = True
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        self.register_variable(Float64("u", causality=Fmi3Causality.input))
        self.register_variable(Float64("y", causality=Fmi3Causality.output))
        self.register_variable(Float64("T", causality=Fmi3Causality.parameter))
        self.register_variable(Int32("order", causality=Fmi3Causality.parameter))
        self.register_variable(Boolean("active", causality=Fmi3Causality.parameter))

    def do_step(self, current_time, step_size):
        if self.active:
            self.y += step_size * self.order * (self.u - self.y) / self.T
        return True
