# SPDX-License-Identifier: Apache-2.0
"""The ``mjsense`` program from its command line to its exit code.

The package begins with ``answer_early``, before it loads the library, which takes 0.6 s: help, completion and wrong usage need
none of it.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from mjsense.commands.output import tell
from mjsense.commands.registry import COMMANDS, WRONG_INPUT, module_of, parser_of

if TYPE_CHECKING:
    import argparse

_BROKEN_PIPE = 141  # as of a program that SIGPIPE ends
_INTERRUPTED = 130  # 128 + SIGINT, as shells report it
_MAX_MESSAGE = 4000  # a message may quote a file of any size


_prepared = False


def is_program() -> bool:
    """Whether this process is ``python -m mjsense``, or the command that the package installs; asked while the package is
    imported."""
    if sys.argv[:1] == ["-m"]:  # until Python has found the module
        return sys.orig_argv[-len(sys.argv)] in ("mjsense", "-mmjsense")
    folder, name = os.path.split(os.path.abspath(sys.argv[0])) if sys.argv else ("", "")
    return name == "mjsense" and folder == os.path.dirname(sys.executable)


def answer_early() -> None:
    """Ends the process if it is the program and its command line needs no library."""
    if is_program():
        prepare_process()
        code = _guarded(lambda: _answer(sys.argv[1:]))
        if code is not None:
            sys.exit(code)


def main(words: Sequence[str]) -> int:
    """Runs the program with the arguments of its command line. Errors are printed on stderr.

    Returns:
        0: done; 1: some episodes or checks failed; 2: wrong usage or input; 130: interrupted; 141: the reader of the output has
            ended.
    """
    code = _guarded(lambda: _answer(words))
    return code if code is not None else _guarded(lambda: _run(words)) or 0


class _OutputError(Exception):
    """stdout cannot be written."""

    def __init__(self, error: OSError) -> None:
        super().__init__(error.strerror)
        self.is_pipe = isinstance(error, BrokenPipeError)


class _Stderr(io.TextIOWrapper):
    """stderr. The program continues if it cannot be written, because the terminal is gone or the disk is full."""

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return len(text)


class _Stdout(io.TextIOWrapper):
    """stdout, whose errors differ from those of files."""

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError as error:
            raise _OutputError(error) from error

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise _OutputError(error) from error


def prepare_process() -> None:
    """Opens the standard streams that are closed, and makes Ctrl-C end the process at once until a command says otherwise.

    The next file that is opened would get the descriptor of a closed stream, and messages would be written into it. Writing to a
    closed stdout remains an error.
    """
    global _prepared
    if _prepared:
        return
    _prepared = True
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    for descriptor, mode in enumerate((os.O_RDWR, os.O_RDONLY, os.O_RDWR)):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, mode)  # the lowest free descriptor is this one
    # Names of files need not be UTF-8, and the output does not depend on the locale.
    sys.stdout = _Stdout(
        io.BufferedWriter(io.FileIO(1, "w", closefd=False)),
        encoding="utf-8",
        errors="surrogateescape",
        line_buffering=os.isatty(1),
    )
    sys.stderr = _Stderr(io.FileIO(2, "w", closefd=False), encoding="utf-8", errors="backslashreplace", write_through=True)  # pyright: ignore[reportArgumentType]


def message_of(error: BaseException) -> str:
    """One line for stderr."""
    if isinstance(error, OSError) and error.filename is not None:  # raised by Python: "[Errno 30] Read-only file system: 'out'"
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    text = error.args[0] if isinstance(error, KeyError) and error.args else error  # str() of a KeyError is a repr
    line = " ".join(str(text).split()) or type(error).__name__
    return line if len(line) <= _MAX_MESSAGE else f"{line[:_MAX_MESSAGE]} ..."


def _guarded(step: Callable[[], int | None]) -> int | None:
    """The result of a step of the program, or its exit code if it fails."""
    try:
        try:
            return step()
        except SystemExit as end:  # of argparse, after the help
            return end.code if isinstance(end.code, int) else 0
        finally:
            sys.stdout.flush()
    except _OutputError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # for the flush when Python ends
        if error.is_pipe:  # the reader of the output, such as head, has ended
            return _BROKEN_PIPE
        tell(f"mjsense: cannot write to stdout: {error}")
    except KeyboardInterrupt as error:
        tell(f"mjsense: interrupted{error}")
        return _INTERRUPTED
    except (ValueError, LookupError, OSError, RuntimeError, ImportError, TypeError, MemoryError) as error:
        tell(f"mjsense: {message_of(error)}")
    return WRONG_INPUT


def _answer(words: Sequence[str]) -> int | None:
    """The exit code, or None if the command needs the library."""
    if not words:
        tell(_help().rstrip("\n"))
        return WRONG_INPUT
    word = words[0]
    if word == "--version":
        return None
    if word in ("-h", "--help", "help") and (word != "help" or len(words) == 1):
        print(_help(), end="")
        return 0
    if word.startswith("-"):
        raise ValueError(f"no option '{word}'; see mjsense --help")
    if word == "complete":
        from mjsense.commands.completion import completions

        print(*completions(words[2:] if words[1:2] == ["--"] else words[1:]), sep="\n")
        return 0
    if word != "help" and word not in COMMANDS:
        _run_external(word, words)
    parsed(words)
    return None


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """The arguments of a command."""
    from mjsense.commands import config

    if words[0] == "help":  # "help record" is "record --help"
        words = [*words[1:], "--help"]
    parser = parser_of(words[0]) if words[0] in COMMANDS else None
    if parser is None:
        raise ValueError(f"no command '{words[0]}'{_nearest_command(words[0])}")
    for path in config.files_of(words[1:]):
        config.apply(parser, path)
    return parser.parse_args(words[1:])


def _run(words: Sequence[str]) -> int:
    from mjsense import _core

    if words[0] == "--version":
        print(f"mjsense {_core.__version__}")  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
        return 0
    arguments = parsed(words)
    module = module_of(arguments.command)
    if _prepared:
        _core.print_warnings_once()
        if not getattr(module, "ENDS_AT_CTRL_C", False):
            signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return module.run(arguments)
    except KeyboardInterrupt:
        resumes = any(action.dest == "resume" for action in parser_of(arguments.command)._actions)
        raise KeyboardInterrupt("; continue with --resume" if resumes else "") from None


def _help() -> str:
    from mjsense.commands.parser import entry

    options = entry("-h,--help", "Print this help and exit.") + entry("--version", "Print the version and exit.")
    listed = "".join(entry(name, about) for name, about in COMMANDS.items())
    return f"""Sensors, cameras and recordings for MuJoCo simulations.

Usage: mjsense [OPTIONS] COMMAND

Options:
{options}
Subcommands:
{listed}
Use `mjsense COMMAND --help` for the options of a command.
An unknown COMMAND runs the program mjsense-COMMAND from PATH.
"""


def _run_external(word: str, words: Sequence[str]) -> None:
    """Replaces this process by the program ``mjsense-WORD`` of ``PATH``, as git does."""
    program = f"mjsense-{word}"
    for number in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores them, and programs inherit that
        signal.signal(number, signal.SIG_DFL)
    try:
        os.execvp(program, list(words))
    except OSError as error:
        for number in (signal.SIGPIPE, signal.SIGXFSZ):
            signal.signal(number, signal.SIG_IGN)
        if error.errno not in (errno.ENOENT, errno.EACCES, errno.ENOTDIR):
            raise RuntimeError(f"{program}: {error.strerror}") from None
    raise ValueError(f"no command '{word}'{_nearest_command(word) or '; see mjsense --help'}")


def _nearest_command(word: str) -> str:
    from mjsense.commands.fields import suggestion

    found = list(COMMANDS)
    for folder in os.get_exec_path():
        try:
            names = [
                entry.name for entry in os.scandir(folder) if entry.name.startswith("mjsense-") and os.access(entry.path, os.X_OK)
            ]
        except OSError:
            continue
        found += [name.removeprefix("mjsense-") for name in names]
    return suggestion(word, found)
