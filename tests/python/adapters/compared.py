# SPDX-License-Identifier: Apache-2.0
"""A renderer that compares its images with those of mujoco.Renderer, for programs of others."""

import mujoco
import numpy as np

import mjsense

THEIRS = mujoco.Renderer
FIRST, EACH = 4, 100  # images of each renderer that are compared


def quality_of(image, theirs):
    """PSNR of rgb, dB; of depths and ids 99 if 99 % of them are those of the other image (depths: within 1 %), and 0 otherwise."""
    assert image.shape == theirs.shape, (image.shape, theirs.shape)
    assert image.dtype == theirs.dtype, (image.dtype, theirs.dtype)
    if image.dtype == np.uint8:
        return 10 * np.log10(255**2 / max(1e-3, np.mean((theirs.astype(float) - image) ** 2)))
    near = np.isclose(image, theirs, rtol=1e-2).reshape(*image.shape[:2], -1).all(-1).mean()
    return 99 if near > 0.99 else 0


class Compared(mjsense.Renderer):
    """Draws the same scene with MuJoCo's renderer, too, and keeps the worst quality by cell of a notebook, dB."""

    images = 0
    worst: dict = {}
    cell = -1

    def __init__(self, model, *args, **kwargs):
        super().__init__(model, *args, **kwargs)
        self._theirs = THEIRS(model, *args, **kwargs)
        self._theirs._scene = self.scene
        self._count = 0

    def render(self, *, out=None):
        image = super().render(out=out)
        self._count += 1
        if self._count <= FIRST or self._count % EACH == 0:
            for kind in ("depth", "segmentation"):
                state = "enable" if getattr(self, f"_{kind}") else "disable"
                getattr(self._theirs, f"{state}_{kind}_rendering")()
            self._compare(image, self._theirs.render())
        return image

    def _compare(self, image, theirs):
        quality = quality_of(image, theirs)
        Compared.images += 1
        Compared.worst[Compared.cell] = min(quality, Compared.worst.get(Compared.cell, 99))

    def close(self):
        if getattr(self, "_theirs", None) is not None:
            self._theirs.close()
            self._theirs = None
        super().close()
