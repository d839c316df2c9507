# SPDX-License-Identifier: Apache-2.0
"""Scenes and sensors as they are configured in mjlab 1.6: change ``mjlab`` to ``mjsense.compat.mjlab`` where they are imported.

    from mjsense.compat.mjlab.entity import EntityArticulationInfoCfg, EntityCfg
    from mjsense.compat.mjlab.scene import Scene, SceneCfg
    from mjsense.compat.mjlab.sensor import ContactMatch, ContactSensorCfg, ObjRef
    from mjsense.compat.mjlab.sim import MujocoCfg, Simulation, SimulationCfg
    from mjsense.compat.mjlab.terrains import TerrainEntityCfg

Fields, defaults and order of arguments are mjlab's; configurations can be changed until the scene is made, and are checked then.
Sensors return torch tensors on the sensors' own memory, NumPy arrays where there is no torch. Everything is on the CPU.

Not here: managers, rewards and the rest of training, actuators that mjlab computes in Python, and sub-terrains other than those of its
``ROUGH_TERRAINS_CFG``; each of these that a configuration names is an error that says so.
"""
