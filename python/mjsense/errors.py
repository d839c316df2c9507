# SPDX-License-Identifier: Apache-2.0
"""The exception class for unknown names. All other errors are ValueError, TypeError or RuntimeError."""

from mjsense._show import printable


class UnknownNameError(KeyError):
    """A name does not exist. The message contains the most similar names."""

    def __str__(self) -> str:
        # KeyError would print the repr of its argument, with quotes and escapes.
        return printable(str(self.args[0])) if self.args else ""
