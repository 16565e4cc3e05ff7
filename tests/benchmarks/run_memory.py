"""The memory of a run: ``python -m tests.benchmarks.run_memory POINTS VESICLES CONTRAST``.

Prints the largest private memory of a process while it simulates, in bytes, and that beyond the interpreter
divided by the square of the number of all points.
"""

from __future__ import annotations

import re
import signal
import sys
import threading
import time
from pathlib import Path

from ensemble.questions import preset_question
from solver import simulate

SECONDS = 300  # what is needed most is needed in the first step
STATUS = Path("/proc/self/status")


def private_bytes() -> int:
    """Return the private memory of this process now."""
    found = re.search(r"VmData:\s+(\d+)", STATUS.read_text())
    assert found is not None
    return 1024 * int(found[1])


def main() -> None:
    """Simulate a row of vesicles and print what that needs."""
    points, vesicles, contrast = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    row = [{"reduced_area": 0.9, "center": [3.0 * number, 0.0]} for number in range(vesicles)]
    changes = {"numerics.points": points, "horizon": 0.02, "vesicles": row}
    question = preset_question("doublet-shear", changes).changed({"vesicles.viscosity_contrast": contrast})
    before, most = private_bytes(), 0

    def watch() -> None:
        nonlocal most
        while True:
            most = max(most, private_bytes())
            time.sleep(0.01)

    def show(*_: object) -> None:
        print(f"{most:.3g} bytes, {(most - before) / (points * vesicles) ** 2:.3g} a pair of points")
        sys.exit()

    threading.Thread(target=watch, daemon=True).start()
    signal.signal(signal.SIGALRM, show)
    signal.alarm(SECONDS)
    simulate(question.document)
    show()


if __name__ == "__main__":
    main()
