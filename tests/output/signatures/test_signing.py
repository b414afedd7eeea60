"""What is refused as a key before anything is computed or signed."""

import pytest

from orchestrator.core.errors import InputError
from orchestrator.output.signatures.signing import check_key, sign

BORDER = "-----{} {}-----\nMCowBQYDK2VwAyEA\n"


@pytest.mark.parametrize(
    "content",
    [
        "no key",
        "",
        BORDER.format("BEGIN", "PUBLIC KEY"),
        BORDER.format("BEGIN", "RSA PUBLIC KEY"),
        BORDER.format("BEGIN", "CERTIFICATE"),
    ],
)
def test_what_holds_no_private_key_is_refused_by_name(content, tmp_path):
    key = tmp_path / "note"
    key.write_text(content, encoding="utf-8")
    for refuse in (check_key, lambda path: sign(path, b"message", "file")):
        with pytest.raises(InputError, match=r"note: it holds no private key .* without \.pub"):
            refuse(key)


@pytest.mark.parametrize("kind", ["PRIVATE KEY", "EC PRIVATE KEY", "OPENSSH PRIVATE KEY"])
def test_a_private_key_passes_after_empty_lines_as_well(kind, tmp_path):
    key = tmp_path / "key"
    key.write_text("\n\n" + BORDER.format("BEGIN", kind), encoding="utf-8")
    check_key(key)
