# SPDX-License-Identifier: Apache-2.0
"""Simulations: worlds of one scene that are stepped together, or follow another program's data."""

from mjsense.sim.attached import Attached, attach
from mjsense.sim.simulation import Simulation

__all__ = ["Attached", "Simulation", "attach"]
