# SPDX-License-Identifier: Apache-2.0
"""Errors of mjsense: ValueError, RuntimeError, and a KeyError that prints as a sentence."""

from mjsense._show import printable


class UnknownNameError(KeyError):
    """A name that does not exist; the message gives the nearest ones."""

    def __str__(self) -> str:
        # KeyError shows the repr of its argument: quotes around a sentence, escapes within.
        return printable(str(self.args[0])) if self.args else ""
