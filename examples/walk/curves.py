# SPDX-License-Identifier: Apache-2.0
"""Draws what train.py --curve has written.

pip install matplotlib
python examples/walk/curves.py rsl.json sb3.json --out curves.png
"""

import argparse
import json
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

NAMES = {"rsl": "rsl-rl", "sb3": "Stable-Baselines3"}


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("files", nargs="+", type=Path)
    options.add_argument("--out", type=Path, default=Path("curves.png"))
    options = options.parse_args()
    runs = [json.loads(file.read_text()) for file in options.files]
    figure, axes = plt.subplots(figsize=(6, 3), dpi=100)
    for run in runs:
        points = run["curve"]
        axes.plot(
            [p["cpu"] for p in points], [p["reward"] for p in points], label=f"{NAMES[run['trainer']]}, {run['worlds']} worlds"
        )
    for name, style in (("standing", "--"), ("random", ":")):
        axes.axhline(runs[0]["results"][name][0], color="gray", linestyle=style, linewidth=1, label=name)
    axes.set(xlabel="CPU time of learning, s", ylabel="reward of 10 s", xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(options.out)


if __name__ == "__main__":
    main()
