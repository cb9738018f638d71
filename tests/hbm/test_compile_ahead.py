"""What the second process compiles is what a run needs."""

import subprocess
import sys

KERNELS = "march solve_contact displace memory_after forgets"
VERIFY = """
from tests.helpers.compiled import small_run
from tribodyn.hbm.time import compile_ahead, coupled_pairs, time_step
import tribodyn as td

kernels = [getattr(time_step, name) for name in {names!r}.split()]
compile_ahead.compile_kernels()
ahead = [len(kernel.signatures) for kernel in kernels]
td.verify(small_run(), at=700.0)
print(ahead, [len(kernel.signatures) for kernel in kernels])
"""


def test_time_integration_of_a_part_needs_no_further_kernel():
    command = [sys.executable, "-c", VERIFY.format(names=KERNELS)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output.strip() == "[1, 1, 1, 1, 1] [1, 1, 1, 1, 1]"
