"""The network of InterPSS' traces of PSS/E: a device, a line, a load and an infinite bus.

Its load takes a constant power: with a load of constant impedance or current, the voltages of both buses in the traces
would turn the infinite bus by 1.0° or 0.5° in a fault to 0.5 pu; with one of constant power it stays within 0.0001°."""

import numpy as np

LINE, SOURCE = 0.1j, 0.05j  # from bus 1 to bus 2, and from there to the infinite bus [pu]
LOAD = 1.0 + 0.5j  # at bus 2 [pu]
ROUNDS = 4  # until the load's current follows: each leaves a twentieth of the change


class TwoBuses:
    """A device at bus 1 that feeds an active power at a voltage there, all in pu of one base."""

    def __init__(self, device, start, power):
        self._device = device
        names = [v.name for v in device.model.outputs]
        self._places = [names.index(name) for name in ("e_re", "e_im", "y_re", "y_im")]
        flow = np.conj(power / start)
        self.far = start - LINE * flow  # voltage at bus 2
        self.infinite = self.far + SOURCE * (np.conj(LOAD / self.far) - flow)

    def voltage(self, x, fault=0.0):
        """At bus 1, with a shunt there."""
        d = self._device
        (found,) = d.model.outputs_function(x, [1.0, 0.0], d.p, d.c)
        e_re, e_im, y_re, y_im = (found[place] for place in self._places)
        fed, Y, through = complex(e_re, e_im), complex(y_re, y_im), LINE + SOURCE
        for _ in range(ROUNDS):
            source = self.infinite - SOURCE * np.conj(LOAD / self.far)
            v = (source / through + fed * Y) / (1 / through + Y + fault)
            self.far = source + SOURCE / through * (v - source)
        return v

    def rate(self, x, fault):
        d, v = self._device, self.voltage(x, fault)
        return np.array(d.model.derivatives(x, [v.real, v.imag], d.p, d.c)).ravel()

    def through_fault(self, Z, step, times):
        """States by name and voltage at each of the times [s], with a fault behind ``Z`` from 50 to 100 ms."""
        x, found = np.array(self._device.x), {}
        for k in range(round(max(times) / step)):
            fault = 1 / Z if 0.05 <= round(k * step, 9) < 0.1 else 0.0
            first = self.rate(x, fault)
            x = x + step / 2 * (first + self.rate(x + step * first, fault))
            if (t := round((k + 1) * step, 9)) in times:
                found[t] = dict(zip(self._device.states, x, strict=True)), self.voltage(x, fault)
        return found
