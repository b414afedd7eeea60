"""The process that reads a vendor's DLL for `vendor_files`: closed off before the DLL is loaded."""

import sys
from pathlib import Path

from fmus.vendor_dll.reading import answer_for
from orchestrator.fmi.confinement import LAYERS, Means, confine

if __name__ == "__main__":
    library, answer = Path(sys.argv[1]), Path(sys.argv[2])
    confine(Means(), LAYERS, answer.parent, [library])
    answer_for(library, answer, with_trial=sys.argv[3:] == ["--try"])
