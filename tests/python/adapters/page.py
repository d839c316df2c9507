# SPDX-License-Identifier: Apache-2.0
"""Runs the code blocks of a page of docs/drop_in, each in a process of its own.

    python page.py PAGE PSNR

The first block draws with OpenGL, the others without it. The images of the first two are compared.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from images import compare, has_opengl

page, psnr = Path(sys.argv[1]), float(sys.argv[2])
blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
assert len(blocks) >= 2, page

END = """
import os
import numpy
numpy.save(os.environ["RESULT"], locals().get("image", 0))
with open("/proc/self/maps") as maps:
    assert os.environ["MUJOCO_GL"] == "egl" or "libEGL" not in maps.read(), "OpenGL is loaded"
os._exit(0)  # without the packages' own clean-up of EGL
"""

results = []
with tempfile.TemporaryDirectory() as folder:
    for i, block in enumerate(blocks):
        if i == 0 and not has_opengl():
            continue
        result = f"{folder}/{i}.npy"
        script = Path(f"{folder}/block_{i}.py")
        script.write_text(block + END if "__main__" not in block else block)
        environment = {**os.environ, "MUJOCO_GL": "disable" if i else "egl", "RESULT": result}
        done = subprocess.run(
            [sys.executable, "-W", "ignore", script], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"block {i} of {page.name}: {done.stdout[-1000:]}{done.stderr[-2000:]}"
        if i < 2:
            results.append(np.load(result))
if len(results) == 2:
    compare(page.name, *results, psnr)
