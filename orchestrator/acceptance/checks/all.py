"""All checks in the order in which they run: what others need comes before them."""

from orchestrator.acceptance.checks import (
    aftermath,
    base,
    evenness,
    extremes,
    file,
    instances,
    loading,
    points,
    port,
    resources,
    ride_through,
    running,
    sampling,
    signs,
    state,
    timing,
    tuning,
)

MODULES = (
    *(file, loading, running, instances, state, sampling, timing, tuning),
    *(port, points, signs, evenness, ride_through, aftermath, extremes, resources),
)
"""Importing them enters their checks."""

ORDER = (
    "fmi_validity", "units", "declared_starts", "declared_dependencies", "loads",
    "runs", "start_values", "initial_outputs", "call_order", "independence", "repeatability", "reading",
    "reset", "reinstantiation",
    "state", "settable_states", "state_size", "tunables", "feedthrough", "sample_time", "delay", "step_invariance",
    "internal_step",
    "steady_state", "later_times", "angles", "rated_frequency", "power_balance", "shown_power", "operating_points",
    "ratings", "signs", "evenness", "limits", "after_dips",
    "nan_input", "extreme_inputs", "memory",
)  # fmt: skip

CHECKS = {name: base.CHECKS[name] for name in ORDER}  # by name
