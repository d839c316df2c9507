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
    name = sys.argv[1].replace("-", "_") if len(sys.argv) > 1 else ""
    if name not in SCRIPTS:
        wrong = (
            f"no script '{sys.argv[1]}'{did_you_mean(name, SCRIPTS, 'there are')}\n" if name not in ("", "_h", "__help") else ""
        )
        print(
            f"{wrong}usage: python -m mjsense.compat.mjlab {{{','.join(SCRIPTS)}}} [options of mjlab's script]", file=sys.stderr
        )
        return 2 if wrong or not name else 0
    os.environ["CUDA_VISIBLE_DEVICES"] = ""  # mjlab's scripts then use the CPU
    use()
    sys.argv = [f"{sys.argv[0]} {name}", *sys.argv[2:]]
    importlib.import_module(f"mjlab.scripts.{name}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
