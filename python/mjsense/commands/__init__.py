# SPDX-License-Identifier: Apache-2.0
"""The ``mjsense`` program, and its commands, one module each.

A module ``mjsense.commands.NAME`` has ``add_arguments(parser)``, ``run(arguments) -> exit code``, and ``EXAMPLES``: pairs of a
command and its explanation. It imports what it needs in ``run``: the program answers ``--help``, completion and wrong usage
before it loads the library.
"""

from mjsense.commands.registry import COMMANDS, FAILED, WRONG_INPUT, module_of, parser_of
from mjsense.commands.start import main as run

__all__ = ["COMMANDS", "FAILED", "WRONG_INPUT", "module_of", "parser_of", "run"]
