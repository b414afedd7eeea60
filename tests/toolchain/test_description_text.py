"""The text of a description is that of Python's own writer."""

import copy
import subprocess
import sys
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, tostring

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.description import model_description
from fmus.toolchain.description_common import text_of


def pythons(root):
    root = copy.deepcopy(root)
    indent(root)
    text = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def test_a_description_is_as_python_writes_it():
    text = model_description(build_model("gfor_phasor"), "guid", "name", "tool")
    assert text == pythons(fromstring(text))


def test_characters_that_xml_writes_otherwise():
    root = Element("a", x='a & b < c > d " e\n\t\r ω', y="'")
    SubElement(root, "b").text = "x < & >"
    SubElement(SubElement(root, "c"), "d", z="")
    assert text_of(root) == pythons(root)


def test_whoever_writes_a_description_waits_for_no_client_of_http():
    """Which the library's own function for such texts imports; 17 ms of a start."""
    asked = "import sys, fmus.toolchain.description; sys.exit('http.client' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0
