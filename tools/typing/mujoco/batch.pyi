# SPDX-License-Identifier: Apache-2.0
# Stub for mujoco.batch, which has no type annotations: every attribute is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
