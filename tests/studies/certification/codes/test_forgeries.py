"""The forgeries of a vendor's trial: whoever knows this program makes every hash fit again, and has no signer's key.

Each was tried by somebody from outside on a certificate of a failing converter. Without a signature what computes
anew is left; with one nothing that was changed is good."""

import json
import shutil
import zipfile

import pytest
from cryptography.hazmat.primitives.asymmetric import ed25519

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.output.signatures.checking import State
from orchestrator.output.signatures.public_key import public_key_of
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.files import HTML, JSON
from orchestrator.studies.certification.signed import Asked, look_at_signature, sign_folder
from orchestrator.studies.certification.verification import read_certificate
from tests.studies.certification.codes.test_forged_rows import issued_in, sealed
from tests.studies.certification.test_signed import write_key


@pytest.fixture(scope="module")
def signed(tmp_path_factory, fmu_path):
    """A failing certificate of a converter with a binding that declares 1.3 pu, its signer's key, and the signers."""
    folder = tmp_path_factory.mktemp("issued")
    keys = tmp_path_factory.mktemp("keys")
    key = ed25519.Ed25519PrivateKey.generate()
    issued_in(folder, fmu_path("gfor"), 1.3)
    sign_folder(folder, read_certificate(folder)[1], write_key(keys / "lab", key))
    (keys / "allowed").write_text(f"lab@example.org {public_key_of(key).line}\n", "ascii")
    return folder, keys / "allowed"


def words_of_the_page(folder, content):
    page = folder / HTML
    page.write_text(page.read_text("utf-8").replace("fails", "passes"), "utf-8")


def the_verdict(folder, content):
    content["verdict"] = "passes"


def a_row_is_not_judged(folder, content):
    row = next(row for row in content["rows"] if not row["accepted"])
    row |= {"judged": False, "accepted": None}


def limits_are_moved(folder, content):
    for row in content["rows"]:
        for criterion in row["criteria"]:
            criterion |= {"limit": 100.0, "accepted": True}


def a_row_file_is_shorter(folder, content):
    path = folder / case_name("dip")
    text = path.read_text("utf-8")
    assert 'stop_time = "' in text
    path.write_text(text.replace('stop_time = "', 'stop_time = "0.'), "utf-8")


def another_title(folder, content):
    content |= {"title": "Approved by the operator", "source": "the operator"}


def another_form(folder, content):
    content["format"] = "code-1"


def an_acceptance(folder, content):
    content["acceptance"] = {"trusted": True, "faults": []}


def another_fmu(folder, content):
    """The file of another converter, though of the same name: here one with a comment in its archive."""
    with zipfile.ZipFile(folder / FMU, "a") as archive:
        archive.comment = b"another"


def no_limit_in_the_binding(folder, content):
    path = folder / BINDING
    path.write_text(path.read_text("utf-8").replace("I_max = 1.3\n", ""), "utf-8")


def a_page_that_says_more(folder, content):
    page = folder / HTML
    text = page.read_text("utf-8")
    page.write_text(text.replace("</style>", "h1::after{content:' PASSES'}</style>"), "utf-8")


def a_page_that_hides(folder, content):
    page = folder / HTML
    page.write_text(
        page.read_text("utf-8").replace("</style>", "tr{display:none}</style>"), "utf-8"
    )


def another_commit(folder, content):
    content["environment"] |= {"Code": "commit 0123456"}


def another_version(folder, content):
    content["environment"] |= {"gfor-cosim": "0.1.0"}


def another_date(folder, content):
    content["made"] = "2020-01-01T00:00:00+00:00"


def a_linked_fmu(folder, content):
    (folder / FMU).rename(folder.parent / "linked.fmu")
    (folder / FMU).symlink_to(folder.parent / "linked.fmu")


def a_file_elsewhere(folder, content):
    (folder.parent / "elsewhere").write_text("x")
    content["files"]["../elsewhere"] = sha256_of(folder.parent / "elsewhere")


IN_FORCE = {
    "words of the page": words_of_the_page,
    "the verdict": the_verdict,
    "a row is not judged": a_row_is_not_judged,
    "limits are moved": limits_are_moved,
    "a row's file is shorter": a_row_file_is_shorter,
    "title and source": another_title,
    "another form": another_form,
    "an acceptance": an_acceptance,
    "no limit in the binding": no_limit_in_the_binding,
    "a page that says more": a_page_that_says_more,
    "a page that hides": a_page_that_hides,
    "a linked FMU": a_linked_fmu,
    "a file elsewhere": a_file_elsewhere,
}
"""What does not hold, signed or not."""

BY_SIGNATURE = {
    "another FMU": another_fmu,
    "another commit": another_commit,
    "another version": another_version,
    "another date": another_date,
}
"""What nobody can see in figures that are the same: a signature alone tells it."""


def forged(signed, tmp_path, change):
    """Return the folder with a change, every hash made anew, and what is wrong with its files."""
    original, _ = signed
    folder = shutil.copytree(original, tmp_path / "forged")
    content = json.loads((folder / JSON).read_text("utf-8"))
    change(folder, content)
    try:
        return folder, sealed(folder, content)
    except InputError as error:
        return folder, str(error)


def state_of(folder, allowed):
    """Return the state of the signature; None where the record is refused before that."""
    try:
        _, content = read_certificate(folder)
    except InputError:
        return None
    return look_at_signature(folder, content, Asked.of_files(allowed, None, None)).state


def test_what_nobody_touched_holds_and_is_good(signed, tmp_path):
    _, faults = forged(signed, tmp_path, lambda folder, content: None)
    assert faults == ""
    assert state_of(signed[0], signed[1]) is State.GOOD


@pytest.mark.parametrize("name", IN_FORCE)
def test_a_forgery_does_not_hold_though_every_hash_fits(signed, tmp_path, name):
    _, faults = forged(signed, tmp_path, IN_FORCE[name])
    assert faults


@pytest.mark.parametrize("name", {**IN_FORCE, **BY_SIGNATURE})
def test_no_forgery_has_a_good_signature(signed, tmp_path, name):
    folder, _ = forged(signed, tmp_path, (IN_FORCE | BY_SIGNATURE)[name])
    assert state_of(folder, signed[1]) in (State.CHANGED, None)


def test_the_command_refuses_each_with_one_error(signed, tmp_path, gfor):
    for k, name in enumerate(("an acceptance", "another form", "another commit")):
        (tmp_path / str(k)).mkdir()
        folder, _ = forged(signed, tmp_path / str(k), (IN_FORCE | BY_SIGNATURE)[name])
        code, _, said = gfor("verify", folder, "--files-only", "--signers", signed[1])
        assert code in (2, 5), said


def test_a_key_twice_is_refused(signed, tmp_path):
    folder = shutil.copytree(signed[0], tmp_path / "twice")
    path = folder / JSON
    text = path.read_text("utf-8")
    path.write_text(text.replace('"verdict":', '"verdict": "passes",\n "verdict":', 1), "utf-8")
    with pytest.raises(InputError, match="'verdict' stands twice"):
        read_certificate(folder)
