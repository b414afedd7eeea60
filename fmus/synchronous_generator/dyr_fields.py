"""Records of a PSS/E dynamics file (DYR) → parts of `synchronous_generator` and their parameters.

Plain data without equations: a reader of DYR files takes from here which part a record is, and which parameters its
fields set. Fields stand in the file's order: ``bus 'NAME' id field field … /``. Field names are PSS/E's.

Sources: PSS/E's model library as it is described in public (PowerWorld's and NEPLAN's model guides, ANDES' reader)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DyrField:
    """One number of a record.

    ``name``: PSS/E's name of the field; ``parameters``: parameters of the component that take the value; none where the
    field only chooses something; ``negated``: parameters that take the negative value; ``times``: name of another field
    of the record; the parameters take the product of both. PSS/E gives some leads as T_A/T_B; ``only``: the only values
    that our part can stand for; empty where it takes every one; ``same_as``: name of another field that must have the
    same value, because our part has one parameter for both; ``not_zero``: whether 0, by which PSS/E means that it
    chooses a value itself, must be refused; ``switch``: whether the parameters are truth values; 0 is false."""

    name: str
    parameters: tuple[str, ...] = ()
    negated: tuple[str, ...] = ()
    times: str = ""
    only: tuple[float, ...] = ()
    same_as: str = ""
    not_zero: bool = False
    switch: bool = False


@dataclass(frozen=True)
class DyrRecord:
    """One kind of record.

    ``kind``: key of the component's table: ``machine``, ``exciter``, ``governor`` or ``stabilizer``; ``converter`` for
    a record that is a whole component; ``part``: its value, the name of our part; for a whole component, its model;
    ``fields``: in the file's order; ``lacks``: parameters of our part that 0 leaves out, as the record has none."""

    kind: str
    part: str
    fields: tuple[DyrField, ...]
    lacks: tuple[str, ...] = ()


def _fields(scope: str, text: str) -> tuple[DyrField, ...]:
    """Fields from ``PSS/E's name:parameter+parameter`` words; a word without ``:`` sets nothing."""
    found = []
    for word in text.split():
        name, _, given = word.partition(":")
        found.append(DyrField(name, tuple(f"{scope}.{p}" for p in given.split("+") if p)))
    return tuple(found)


def _x(text: str) -> tuple[DyrField, ...]:
    return _fields("exciter", text)


def _g(text: str) -> tuple[DyrField, ...]:
    return _fields("governor", text)


def _s(text: str) -> tuple[DyrField, ...]:
    return _fields("pss", text)


_SATURATION = "E1:E_1 SE(E1):S_E1 E2:E_2 SE(E2):S_E2"
_EXCITER_GAIN = DyrField("KE", ("exciter.K_E",), not_zero=True)
_CEILING = DyrField("VRMAX", ("exciter.V_RMAX",), not_zero=True)
_SWITCH = DyrField("Switch", only=(0.0,))
_SPEED_AND_POWER = (
    DyrField("IC1", only=(1.0,)), DyrField("REMBUS1"), DyrField("IC2", only=(3.0,)), DyrField("REMBUS2"),
    DyrField("M", only=(5.0,)), DyrField("N", only=(1.0,)),
)  # fmt: skip
_POWER_INTEGRAL = "TW1:T_w1 TW2:T_w2 T6:T_6 TW3:T_w3 TW4:T_w4 T7:T_7 KS2:K_s2 KS3:K_s3 T8:T_8 T9:T_9 KS1:K_s1"
_DC1A = (
    *_x("TR:T_R KA:K_A TA:T_A TB:T_B TC:T_C"), _CEILING, *_x("VRMIN:V_RMIN"), _EXCITER_GAIN,
    *_x("TE:T_E KF:K_F TF1:T_F"), _SWITCH, *_x(_SATURATION),
)  # fmt: skip
_AC4A = _x("TR:T_R VIMAX:V_IMAX VIMIN:V_IMIN TC:T_C TB:T_B KA:K_A TA:T_A VRMAX:V_RMAX VRMIN:V_RMIN KC:K_C")

DYR_RECORDS: dict[str, DyrRecord] = {
    "GENCLS": DyrRecord("machine", "classical", _fields("machine", "H:H D:D")),
    "GENROU": DyrRecord(
        "machine",
        "genrou",
        _fields(
            "machine",
            "T'do:T_d10 T''do:T_d20 T'qo:T_q10 T''qo:T_q20 H:H D:D Xd:X_d Xq:X_q X'd:X_d1 X'q:X_q1 X''d:X_d2 Xl:X_l "
            "S(1.0):s_10 S(1.2):s_12",
        ),
    ),
    "GENSAL": DyrRecord(
        "machine",
        "gensal",
        _fields(
            "machine",
            "T'do:T_d10 T''do:T_d20 T''qo:T_q20 H:H D:D Xd:X_d Xq:X_q X'd:X_d1 X''d:X_d2 Xl:X_l "
            "S(1.0):s_10 S(1.2):s_12",
        ),
    ),
    "SEXS": DyrRecord(
        "exciter",
        "sexs",
        (DyrField("TA/TB", ("exciter.T_A",), times="TB"), *_x("TB:T_B K:K TE:T_E EMIN:E_MIN EMAX:E_MAX")),
        ("exciter.T_R",),
    ),
    "IEEET1": DyrRecord(
        "exciter",
        "ieeet1",
        (
            *_x("TR:T_R KA:K_A TA:T_A"), _CEILING, *_x("VRMIN:V_RMIN"), _EXCITER_GAIN,
            *_x("TE:T_E KF:K_F TF:T_F"), _SWITCH, *_x(_SATURATION),
        ),
    ),
    "IEEEX1": DyrRecord("exciter", "dc1a", _DC1A),
    "ESDC1A": DyrRecord("exciter", "dc1a", _DC1A),
    "EXAC1": DyrRecord(
        "exciter",
        "ac1a",
        _x(
            "TR:T_R TB:T_B TC:T_C KA:K_A TA:T_A VRMAX:V_AMAX+V_RMAX VRMIN:V_AMIN+V_RMIN TE:T_E KF:K_F TF:T_F KC:K_C "
            f"KD:K_D KE:K_E {_SATURATION}"
        ),
    ),
    "ESAC1A": DyrRecord(
        "exciter",
        "ac1a",
        _x(
            "TR:T_R TB:T_B TC:T_C KA:K_A TA:T_A VAMAX:V_AMAX VAMIN:V_AMIN TE:T_E KF:K_F TF:T_F KC:K_C KD:K_D KE:K_E "
            f"{_SATURATION} VRMAX:V_RMAX VRMIN:V_RMIN"
        ),
    ),
    "EXAC4": DyrRecord("exciter", "ac4a", _AC4A),
    "ESAC4A": DyrRecord("exciter", "ac4a", _AC4A),
    "EXST1": DyrRecord(
        "exciter",
        "st1a",
        _x(
            "TR:T_R VIMAX:V_IMAX VIMIN:V_IMIN TC:T_C TB:T_B KA:K_A TA:T_A VRMAX:V_RMAX VRMIN:V_RMIN KC:K_C KF:K_F "
            "TF:T_F"
        ),
    ),
    "ESST1A": DyrRecord(
        "exciter",
        "st1a",
        (
            DyrField("UEL"),
            DyrField("VOS", only=(1.0,)),
            *_x(
                "TR:T_R VIMAX:V_IMAX VIMIN:V_IMIN TC:T_C TB:T_B TC1:T_C1 TB1:T_B1 KA:K_A TA:T_A VAMAX:V_AMAX "
                "VAMIN:V_AMIN VRMAX:V_RMAX VRMIN:V_RMIN KC:K_C KF:K_F TF:T_F KLR:K_LR ILR:I_LR"
            ),
        ),
    ),
    "ESST4B": DyrRecord(
        "exciter",
        "st4b",
        (
            *_x(
                "TR:T_R KPR:K_PR KIR:K_IR VRMAX:V_RMAX VRMIN:V_RMIN TA:T_A KPM:K_PM KIM:K_IM VMMAX:V_MMAX "
                "VMMIN:V_MMIN KG:K_G KP:K_P"
            ),
            DyrField("KI", only=(0.0,)),
            *_x("VBMAX:V_BMAX KC:K_C"),
            DyrField("XL", only=(0.0,)),
            DyrField("THETAP", only=(0.0,)),
        ),
    ),
    "TGOV1": DyrRecord("governor", "tgov1", _g("R:R T1:T_1 VMAX:V_MAX VMIN:V_MIN T2:T_2 T3:T_3 Dt:D_t")),
    "HYGOV": DyrRecord(
        "governor",
        "hygov",
        _g(
            "R:R r:r Tr:T_r Tf:T_f Tg:T_g VELM:VELM GMAX:G_MAX GMIN:G_MIN TW:T_W At:A_t Dturb:D_turb qNL:q_NL",
        ),
    ),
    "GAST": DyrRecord(
        "governor", "gast", _g("R:R T1:T_1 T2:T_2 T3:T_3 AT:A_T KT:K_T VMAX:V_MAX VMIN:V_MIN Dturb:D_turb")
    ),
    "IEEEG1": DyrRecord(
        "governor",
        "ieeeg1",
        (
            DyrField("JBUS", only=(0.0,)),
            DyrField("M"),
            *_g(
                "K:K T1:T_1 T2:T_2 T3:T_3 Uo:U_o Uc:U_c PMAX:P_MAX PMIN:P_MIN T4:T_4 K1:K_1 K2:K_2 T5:T_5 K3:K_3 "
                "K4:K_4 T6:T_6 K5:K_5 K6:K_6 T7:T_7 K7:K_7 K8:K_8"
            ),
        ),
    ),
    "STAB1": DyrRecord(
        "stabilizer",
        "pss1a",
        (
            *_s("K/T:K_S T:T_5"), DyrField("T1/T3", ("pss.T_1",), times="T3"), *_s("T3:T_2"),
            DyrField("T2/T4", ("pss.T_3",), times="T4"), *_s("T4:T_4"),
            DyrField("HLIM", ("pss.V_STMAX",), negated=("pss.V_STMIN",)),
        ),
    ),
    "IEEEST": DyrRecord(
        "stabilizer",
        "pss1a",
        (
            DyrField("IM", only=(1.0,)), DyrField("IB"), *_s("A1:A_1 A2:A_2"),
            *(DyrField(name, only=(0.0,)) for name in ("A3", "A4", "A5", "A6")),
            *_s("T1:T_1 T2:T_2 T3:T_3 T4:T_4 T5:T_5"), DyrField("T6", same_as="T5"),
            *_s("KS:K_S LSMAX:V_STMAX LSMIN:V_STMIN"), DyrField("VCU", only=(0.0,)), DyrField("VCL", only=(0.0,)),
        ),
    ),
    "PSS2A": DyrRecord(
        "stabilizer",
        "pss2a",
        (
            *_SPEED_AND_POWER,
            *_s(f"{_POWER_INTEGRAL} T1:T_1 T2:T_2 T3:T_3 T4:T_4 VSTMAX:V_STMAX VSTMIN:V_STMIN"),
        ),
    ),
    "PSS2B": DyrRecord(
        "stabilizer",
        "pss2b",
        (
            *_SPEED_AND_POWER,
            *_s(
                f"{_POWER_INTEGRAL} T1:T_1 T2:T_2 T3:T_3 T4:T_4 T10:T_10 T11:T_11 VS1MAX:V_SI1MAX VS1MIN:V_SI1MIN "
                "VS2MAX:V_SI2MAX VS2MIN:V_SI2MIN VSTMAX:V_STMAX VSTMIN:V_STMIN"
            ),
        ),
    ),
}  # fmt: skip
"""By PSS/E's name. What a part holds and a record does not set keeps our default: give X'_d of GENCLS, and R_s of
every machine, from the network data (ZSORCE) as ``machine.X_d1`` and ``machine.R_s``; machine data are on ``S_n``
unless ``machine.S_data`` [MVA] says otherwise, as MBASE does."""

MACHINE_VARIANTS = {"genrou_rated_speed": "genrou"}
"""Machines that have the fields of another one's record, and differ in an assumption."""
