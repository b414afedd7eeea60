"""A slave of plain pythonfmu whose step fails: pythonfmu gives the instance up and says ``fmi2Fatal``."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Raising(Fmi2Slave):
    """Fails from 0.05 s on."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        """Count, then fail."""
        if current_time > 0.049:
            raise RuntimeError("out of range")
        self.y += step_size
        return True
