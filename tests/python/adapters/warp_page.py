# SPDX-License-Identifier: Apache-2.0
"""Runs both code blocks of docs/drop_in/mujoco_warp.md, compares their images and prints the CPU time of an image with each.

python warp_page.py PAGE [ROUNDS] [PICTURE]

Without ROUNDS only the page's own size is drawn, once. PICTURE is a .png of both images of the first world in 256 x 256 pixels.
"""

import re
import statistics
import sys
import time
from pathlib import Path

import numpy as np

blocks = re.findall(r"^```python\n(.*?)^```$", Path(sys.argv[1]).read_text(), re.MULTILINE | re.DOTALL)
rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 0
assert len(blocks) == 2
assert "mjsense" not in blocks[0]


def milliseconds(draw):
    """CPU time of `draw`, of all threads."""
    start = time.process_time()
    draw()
    return 1e3 * (time.process_time() - start)


for width, height in ((84, 84), (256, 256), (640, 480)) if rounds else ((84, 84),):
    programs = []
    for block in blocks:
        for old, new in (
            ("cam_res=(84, 84)", f"cam_res=({width}, {height})"),
            ("(16, 84, 84)", f"(16, {height}, {width})"),
            ("height=84, width=84", f"height={height}, width={width}"),
        ):
            block = block.replace(old, new)
        programs.append({})
        exec(block, programs[-1])
    theirs, ours = (255 * programs[0]["images"]).round().astype(np.uint8), programs[1]["images"]
    assert theirs.shape == ours.shape == (16, height, width, 3)
    qpos = programs[1]["worlds"].qpos
    assert qpos.numpy().ctypes.data == qpos.ptr  # no copy
    for data, position in zip(programs[1]["datas"], qpos.numpy(), strict=True):
        np.testing.assert_array_equal(data.geom_xpos[2], position[:3].astype(float))
    red = [(image[..., 0] > 100) & (image[..., 1] < 60) for image in (theirs[0], ours[0])]
    assert (red[0] & red[1]).sum() > 0.9 * (red[0] | red[1]).sum() > 0.02 * width * height
    if len(sys.argv) > 3 and width == 256:
        from mjsense.core.png import png_of

        Path(sys.argv[3]).write_bytes(png_of(np.concatenate((theirs[0], ours[0]), 1)))
    if rounds:
        times = [[milliseconds(program["draw"]) / 16 for program in programs] for _ in range(rounds)]
        before, after = (statistics.median(column) for column in zip(*times, strict=True))
        print(f"| {width} x {height} | {before:.2g} ms | {after:.2g} ms | {before / after:.2g} |", flush=True)
