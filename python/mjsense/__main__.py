# SPDX-License-Identifier: Apache-2.0
"""The ``mjsense`` program: ``python -m mjsense``, and the command that the package installs."""

from __future__ import annotations

import sys

from mjsense.commands import start


def main() -> int:
    """Runs the program with the arguments of this process and returns its exit code."""
    start.prepare_process()
    return start.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
