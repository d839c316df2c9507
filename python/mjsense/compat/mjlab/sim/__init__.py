# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sim``: worlds of a scene, stepped in mjlab's order of calls."""

from mjsense.compat.mjlab.sim.sim import Data, MujocoCfg, Simulation, SimulationCfg

__all__ = ["Data", "MujocoCfg", "Simulation", "SimulationCfg"]
