# SPDX-License-Identifier: Apache-2.0
"""MolmoSpaces' own programs, unchanged, draw with mjsense after ``mjsense.compat.molmospaces.use()``.

Tasks, policies, robots and sensors that are written for MolmoSpaces run in mjsense's worlds: change ``molmo_spaces`` to
``mjsense.compat.molmospaces`` where they are imported.

    from mjsense.compat.molmospaces.env.abstract_sensors import Sensor, SensorSuite
    from mjsense.compat.molmospaces.env.sensors import GraspStateSensor, ObjectStartPoseSensor, get_core_sensors
    from mjsense.compat.molmospaces.policy.base_policy import BasePolicy, PlannerPolicy
    from mjsense.compat.molmospaces.robots.abstract import Robot
    from mjsense.compat.molmospaces.tasks.task import BaseMujocoTask

A task is one of mjsense's tasks (:attr:`BaseMujocoTask.played`) with the sensors that you compose. ``mjsense.make_vec``,
``mjsense.make`` and ``mjsense.record`` accept it, and it has MolmoSpaces' ``reset``, ``step`` and ``get_observations``.

Not supported: scenes, objects and assets of MolmoSpaces, its planners, and the bundles of sensors that its documentation advises
against.
"""

from mjsense.compat.molmospaces.env.abstract_sensors import Sensor, SensorSuite
from mjsense.compat.molmospaces.env.sensors import *  # noqa: F403
from mjsense.compat.molmospaces.env.sensors import __all__ as _sensors
from mjsense.compat.molmospaces.policy.base_policy import BasePolicy, InferencePolicy, PlannerPolicy, StatefulPolicy
from mjsense.compat.molmospaces.program import stop, use, used
from mjsense.compat.molmospaces.robots.abstract import Robot
from mjsense.compat.molmospaces.tasks.task import BaseMujocoTask
from mjsense.compat.molmospaces.utils.save_utils import byte_array_to_string, dict_to_byte_array, is_camera_sensor

__all__ = [
    "BaseMujocoTask",
    "BasePolicy",
    "InferencePolicy",
    "PlannerPolicy",
    "Robot",
    "Sensor",
    "SensorSuite",
    "StatefulPolicy",
    "byte_array_to_string",
    "dict_to_byte_array",
    "is_camera_sensor",
    "stop",
    "use",
    "used",
    *_sensors,
]
