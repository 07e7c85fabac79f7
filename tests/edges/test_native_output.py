"""What native libraries print stays out of what coramp prints."""

import json
import subprocess
import sys
from pathlib import Path


def test_a_line_of_highs_does_not_get_into_json():
    words = "run paper --engine exact -s milp-sequence --mainline 1800 --ramp 500 --seed 3 --json"
    settings = "--horizon 200 --set safety.time_gap_s=1.0 --set simulation.drain_s=300.0"
    command = [Path(sys.executable).with_name("coramp"), *words.split(), *settings.split()]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0
    assert json.loads(result.stdout)["strategy"] == "milp-sequence"


def test_native_lines_go_to_stderr_and_pythons_own_stay():
    code = (
        "import os\n"
        "from coramp.cli.native_output import send_native_output_to_stderr\n"
        "send_native_output_to_stderr()\n"
        "os.write(1, b'native\\n')\n"
        "print('own')\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert (result.stdout, result.stderr) == ("own\n", "native\n")
