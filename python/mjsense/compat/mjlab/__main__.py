# SPDX-License-Identifier: Apache-2.0
"""mjlab's own scripts, on the CPU, with the physics of mjsense:

python -m mjsense.compat.mjlab train Mjlab-Velocity-Flat-Unitree-Go1 --env.scene.num-envs 1024
"""

from __future__ import annotations

import importlib
import os
import sys

from mjsense.compat.mjlab import use
from mjsense.core.errors import did_you_mean

SCRIPTS = ("train", "play", "demo", "list_envs", "nan_viz", "export_scene")
"""Modules of ``mjlab.scripts`` that are programs."""


def main() -> int:
    given = sys.argv[1] if len(sys.argv) > 1 else ""
    name = given.replace("-", "_")
    if name not in SCRIPTS:
        asks = given in ("-h", "--help")
        if given and not asks:
            print(f"no script '{given}'{did_you_mean(name, SCRIPTS, 'there are')}", file=sys.stderr)
        usage = f"usage: python -m mjsense.compat.mjlab {{{','.join(SCRIPTS)}}} [options of mjlab's script]"
        print(usage, file=sys.stdout if asks else sys.stderr)
        return 0 if asks else 2
    os.environ["CUDA_VISIBLE_DEVICES"] = ""  # mjlab's scripts then use the CPU
    use()
    sys.argv = [f"{sys.argv[0]} {name}", *sys.argv[2:]]
    importlib.import_module(f"mjlab.scripts.{name}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
