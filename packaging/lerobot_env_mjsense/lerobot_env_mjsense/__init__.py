# SPDX-License-Identifier: Apache-2.0
"""mjsense's tasks as environments of LeRobot. Importing this package registers the environment type ``mjsense``."""

from lerobot_env_mjsense.config import MjsenseEnvConfig
from lerobot_env_mjsense.environments import LeRobotEnv, LeRobotVectorEnv

__all__ = ["LeRobotEnv", "LeRobotVectorEnv", "MjsenseEnvConfig"]
