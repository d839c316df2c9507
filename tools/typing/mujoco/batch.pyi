# SPDX-License-Identifier: Apache-2.0
# mujoco has no types of its own: everything in it is anything.
from typing import Any

def __getattr__(name: str) -> Any: ...
