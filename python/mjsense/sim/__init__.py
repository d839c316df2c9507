# SPDX-License-Identifier: Apache-2.0
"""Worlds of one scene that are stepped together, and sensors and images of the data that another program steps."""

from mjsense.sim.attached import Attached, attach
from mjsense.sim.renderer import Renderer
from mjsense.sim.simulation import Simulation

__all__ = ["Attached", "Renderer", "Simulation", "attach"]
