"""The example that is a program of the vendor's library, as it stands, with a shield between it and a served arm."""

import re
import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[3] / "examples" / "09_libfranka_program.py"


def test_a_program_of_the_vendors_library_yields_to_a_push_and_goes_on(serve):
    served = serve("fr3", "--lockstep", "--push", "3:0,30,0:0.3")
    ended = subprocess.run(
        [sys.executable, EXAMPLE, served.address], capture_output=True, text=True, timeout=240, check=False
    )
    assert ended.returncode == 0, ended.stderr
    told = re.findall(r"^([\d.]+) s: (.*)$", ended.stdout, re.MULTILINE)
    contacts = [float(at) for at, reason in told if "contact" in reason]
    assert contacts, ended.stdout
    assert 3.0 <= contacts[0] <= 3.1  # pushed 3 s after the motion began
    assert told[-1][1] == "Moving as requested."
    assert "at rest after 6" in ended.stdout
