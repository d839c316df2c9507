# SPDX-License-Identifier: Apache-2.0
# Stub for mujoco_warp, which only the extra `warp` installs: every attribute is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
