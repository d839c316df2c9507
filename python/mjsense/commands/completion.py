# SPDX-License-Identifier: Apache-2.0
"""``mjsense completion``, and the words that the shells' scripts ask for with ``mjsense complete``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

EXAMPLES = [
    (
        "source <(mjsense completion bash)",
        "Enable completion in this shell; to enable it permanently, add the line to ~/.bashrc.",
    ),
    ("mjsense completion fish > ~/.config/fish/completions/mjsense.fish", "Enable completion in fish."),
]
_SCRIPTS = {
    "bash": """# source <(mjsense completion bash)
_mjsense() {
  local IFS=$'\\n'
  COMPREPLY=($(mjsense complete -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
complete -o default -F _mjsense mjsense
""",
    "zsh": """#compdef mjsense
# source <(mjsense completion zsh)
_mjsense() {
  local -a found
  found=(${(f)"$(mjsense complete -- "${(@)words[2,CURRENT]}" 2>/dev/null)"})
  if (( ${#found} )); then compadd -- $found; else _files; fi
}
compdef _mjsense mjsense
""",
    "fish": """# mjsense completion fish | source
function __mjsense_complete
    set -l words (commandline -opc) (commandline -ct)
    mjsense complete -- $words[2..-1] 2>/dev/null
end
complete -c mjsense -a '(__mjsense_complete)'
""",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=_SCRIPTS, metavar="SHELL", help="bash, zsh or fish.")


def run(arguments: argparse.Namespace) -> int:
    print(_SCRIPTS[arguments.shell], end="")
    return 0


def completions(words: Sequence[str]) -> list[str]:
    """Completions of the last of these words, which follow the name of the program."""
    from mjsense.commands.registry import COMMANDS, parser_of

    last = words[-1] if words else ""
    if len(words) < 2:
        found = ["-h", "--help", "--version"] if last.startswith("-") else list(COMMANDS)
    elif words[0] not in COMMANDS:
        found = []
    else:
        parser = parser_of(words[0])
        options = {name: action for action in parser._actions for name in action.option_strings}
        before = options.get(words[-2])
        if last.startswith("-"):
            found = list(options)
        elif before is not None and before.nargs != 0:
            found = _words_of(before)
        else:
            found = next((_words_of(action) for action in parser._actions if not action.option_strings), [])
    return [name for name in found if name.startswith(last)]


def _words_of(action: argparse.Action) -> list[str]:
    return [str(word) for word in getattr(action, "completions", action.choices or ())]
