"""Parts of a generator by name: which fit each other, what DYR records they are, and their defaults."""

import re

import pytest

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from fmus.synchronous_generator.parts import EXCITERS, GOVERNORS, MACHINES, STABILIZERS
from fmus.toolchain.catalogue import parts_of

ONE_BY_ONE = [
    *({"machine": name} for name in MACHINES),
    *({"exciter": name} for name in EXCITERS),
    *({"governor": name} for name in GOVERNORS),
    *({"exciter": "st1a", "stabilizer": name} for name in STABILIZERS),
]


def with_part(kind, name):
    """A generator with a part, beside others that it fits; what a compensator sets, the exciter has."""
    if kind == "compensator":
        return synchronous_generator(exciter="st1a")
    if kind == "supervisor":
        return synchronous_generator(governor=f"tgov1_{name}")
    return synchronous_generator(
        **({"exciter": "st1a"} if kind in ("stabilizer", "oel", "uel") else {}) | {kind: name}
    )


@pytest.mark.parametrize("parts", ONE_BY_ONE, ids=lambda parts: "-".join(parts.values()))
def test_the_defaults_of_every_part_are_plausible(parts):
    both = parts.get("machine") != "genrou_rated_speed"  # which is for phasors alone
    for factory in (synchronous_generator_phasor, *([synchronous_generator] if both else [])):
        for variable in factory(**parts).parameters:
            assert variable.usual is None or variable.usual.fits(variable.start), variable.name


def test_a_generator_is_named_after_its_parts():
    made = synchronous_generator("genrou", "st1a", "tgov1", "pss1a")
    assert made.name == "synchronous_generator_genrou_st1a_tgov1_pss1a"
    assert synchronous_generator().name == "synchronous_generator_genrou_manual_constant_torque"
    assert synchronous_generator_phasor("gensal", "sexs").name.endswith(
        "gensal_sexs_constant_torque_phasor"
    )


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (
            {"machine": "genru"},
            "there is no machine 'genru'; did you mean 'genrou'? there are: classical, two_axis",
        ),
        ({"exciter": "EXST1"}, "there is no exciter 'EXST1'; "),
        (
            {"governor": "x"},
            "there is no governor 'x'; there are: constant_power, constant_torque, tgov1",
        ),
        ({"stabilizer": "PSS1A"}, "there is no stabilizer 'PSS1A'; did you mean 'pss1a'?"),
        ({"machine": "classical", "exciter": "sexs"}, "the classical machine has no field winding"),
        ({"stabilizer": "pss1a"}, "manual excitation has none"),
    ],
)
def test_parts_that_are_not_there_or_do_not_fit_are_named(parts, said):
    for factory in (synchronous_generator, synchronous_generator_phasor):
        with pytest.raises(ValueError, match=re.escape(said)):
            factory(**parts)


def test_the_catalogue_knows_which_models_have_parts():
    expected = {
        "machine": "genrou",
        "exciter": "manual",
        "governor": "constant_torque",
        "stabilizer": "none",
        "oel": "none",
        "uel": "none",
    }
    assert parts_of("synchronous_generator") == parts_of("synchronous_generator_phasor") == expected
    assert parts_of("gfor") == {}


@pytest.mark.parametrize("name", DYR_RECORDS)
def test_every_field_of_a_dyr_record_sets_a_parameter_of_its_part(name):
    record = DYR_RECORDS[name]
    known = {v.name for v in with_part(record.kind, record.part).parameters}
    names = [field.name for field in record.fields]
    assert len(set(names)) == len(names)
    for field in record.fields:
        assert {*field.parameters, *field.negated} <= known, field.name
        assert not field.times or field.times in names
        assert not field.same_as or field.same_as in names
        assert not field.nothing_without or field.nothing_without in names
        assert not field.zero_sets or field.zero_sets in known
    given = {p for field in record.fields for p in (*field.parameters, *field.negated)}
    assert len(given) == sum(len(field.parameters) + len(field.negated) for field in record.fields)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("GENROU", 14),
        ("GENSAL", 12),
        ("GENROE", 14),
        ("GENSAE", 12),
        ("GENTPJ1", 16),
        ("GENTPJU1", 22),
        ("GENCLS", 2),
        ("SEXS", 6),
        ("IEEET1", 14),
        ("IEEEX1", 16),
        ("IEEEX2", 16),
        ("EXDC1", 16),
        ("SCRX", 8),
        ("BBSEX1", 11),
        ("EXNI", 10),
        ("EXST2", 13),
        ("EXST3", 18),
        ("IEEET4", 11),
        ("IEEET5", 10),
        ("IEEX2A", 15),
        ("ESAC2A", 22),
        ("ESAC3A", 22),
        ("EXAC3", 22),
        ("REXSYS", 31),
        ("REXSY1", 33),
        ("EXPIC1", 24),
        ("DC4B", 20),
        ("AC7B", 27),
        ("DEGOV", 10),
        ("DEGOV1", 13),
        ("IEEET2", 14),
        ("ESDC2A", 16),
        ("EXDC2", 16),
        ("EXAC2", 23),
        ("ESAC6A", 23),
        ("AC8B", 21),
        ("ESAC8B", 15),
        ("GGOV1", 35),
        ("IEESGO", 11),
        ("ST2CUT", 20),
        ("STAB2A", 8),
        ("EXAC1", 17),
        ("ESAC1A", 19),
        ("EXAC4", 10),
        ("EXST1", 12),
        ("ESST1A", 20),
        ("ESST4B", 17),
        ("TGOV1", 7),
        ("HYGOV", 12),
        ("GAST", 9),
        ("IEEEG1", 22),
        ("WSIEG1", 36),
        ("IEEEG2", 7),
        ("IEEEG3", 14),
        ("HYGOV2", 16),
        ("TGOV3", 18),
        ("GAST2A", 31),
        ("PIDGOV", 21),
        ("WPIDHY", 21),
        ("WSHYGP", 30),
        ("WEHGOV", 50),
        ("COMP", 1),
        ("IEEEVC", 2),
        ("LCFB1", 9),
        ("OEL2C", 43),
        ("OEL2CU1", 49),
        ("OEL3C", 12),
        ("OEL4C", 5),
        ("UEL2", 41),
        ("UEL2C", 51),
        ("UEL2CU1", 57),
        ("STAB1", 7),
        ("IEEEST", 19),
        ("PSS2A", 23),
        ("PSS2B", 29),
    ],
)
def test_a_record_has_as_many_fields_as_pss_e_has(name, count):
    """CONs and ICONs of PSS/E's model library."""
    assert len(DYR_RECORDS[name].fields) == count
