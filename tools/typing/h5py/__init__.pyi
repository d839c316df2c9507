# SPDX-License-Identifier: Apache-2.0
# Stub for h5py, which has no type annotations: every attribute is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
