# SPDX-License-Identifier: Apache-2.0
# h5py has no types of its own: everything in it is anything.
from typing import Any

def __getattr__(name: str) -> Any: ...
