# SPDX-License-Identifier: Apache-2.0
# Stub for Warp, which only the extra `warp` installs and whose kernels are not Python: every attribute is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
