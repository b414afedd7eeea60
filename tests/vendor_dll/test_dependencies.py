"""What an FMU around a DLL declares to depend on what, without a circuit and without a compiler."""

import pytest

from fmus.vendor_dll import source
from fmus.vendor_dll.description import _dependencies

OTHERS = tuple(
    role
    for name, role in vars(source).items()
    if name.isupper() and isinstance(role, int) and not isinstance(role, bool)
)


def variable(name, role, local=False):
    return source.HostVariable(name, role, "Real", 10, 0, local=local)


def test_outputs_alone_have_dependencies_and_follow_no_input_at_once():
    """The DLL's outputs are held since its last sample."""
    variables = (
        variable("T", source.PARAMETER),
        variable("u", source.INPUT),
        variable("y", source.OUTPUT),
        variable("v_a", source.OUTPUT, local=True),
        variable("z", source.OUTPUT),
    )
    assert _dependencies(variables, None) == {3: [], 5: []}


@pytest.mark.parametrize("role", sorted(set(OTHERS) - {source.OUTPUT}))
def test_no_other_role_is_an_output(role):
    assert _dependencies((variable("x", role),), None) == {}
