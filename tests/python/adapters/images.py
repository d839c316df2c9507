# SPDX-License-Identifier: Apache-2.0
"""Comparison of images of a package's own renderer and of mjsense, for the scripts of this folder."""

import os
import subprocess
import sys

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np


def has_opengl():
    """Whether the machine has OpenGL for the packages' own images."""
    probe = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).close()"
    # Not in this process: the packages' own images are wrong after mujoco.Renderer has used EGL in the same thread.
    return subprocess.run([sys.executable, "-W", "ignore", "-c", probe], capture_output=True, check=False).returncode == 0


def require_opengl():
    """Ends the script with code 77 if the machine has no OpenGL."""
    if not has_opengl():
        print("mujoco.Renderer does not work here")
        sys.exit(77)


def end():
    """Ends the script without the packages' EGL clean-up at exit, which fails if two packages have used EGL."""
    sys.stdout.flush()
    os._exit(0)


def compare(what, theirs, ours, psnr=None, far=None):
    """Compares rgb with PSNR; depth [m] by its median error, without pixels beyond `far`; segmentation by equal pixels."""
    assert theirs.shape == ours.shape, (what, theirs.shape, ours.shape)
    assert theirs.dtype == ours.dtype, (what, theirs.dtype, ours.dtype)
    if ours.dtype == np.uint8:
        assert ours.std() > 5, f"{what}: empty image"
        found = 10 * np.log10(255**2 / max(1e-3, np.mean((theirs.astype(float) - ours) ** 2)))
        print(f"{what}: PSNR {found:.1f} dB")
        assert found >= psnr, what
    elif ours.dtype == np.float32:
        near = theirs < (far or np.inf)
        error = np.median(np.abs(theirs - ours)[near])
        print(f"{what}: median error of depth {1e3 * error:.3f} mm")
        assert error < 1e-3, what
    else:
        same = (theirs == ours).reshape(*ours.shape[:2], -1).all(-1).mean()
        print(f"{what}: {100 * same:.2f} % of the pixels have the same segmentation")
        assert same >= 0.995, what


def compare_depth(what, model, data, camera, ours):
    """Compares depth in metres with mujoco.Renderer's. Called after all images of the package itself: see require_opengl()."""
    with mujoco.Renderer(model, *ours.shape) as renderer:
        renderer.update_scene(data, camera)
        renderer.enable_depth_rendering()
        expected = renderer.render()
    compare(f"{what} depth", expected, ours, far=0.5 * model.vis.map.zfar * model.stat.extent)
