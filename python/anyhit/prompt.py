"""The debugger's prompt: ``anyhit.breakpoint``."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from typing import Callable, ContextManager, Optional, Union

from ._anyhit import ComputeTest, LoadedScene, ShaderTest
from .errors import InvalidType, UnsupportedTool

__all__ = ["breakpoint"]

_PROMPT = "(anyhit) "

# Surrounds a prompt, as pytest captures input and output.
_surroundings: list[Callable[[], ContextManager[None]]] = []


def breakpoint(
    test: Union[ShaderTest, ComputeTest, LoadedScene],
    at: Optional[Union[int, str, Sequence[int]]] = None,
) -> None:
    """Opens the debugger's prompt before the first line of a shader.

    ``at`` is the ``GlobalInvocationId`` of a ``ComputeTest``, by default (0, 0, 0), or the pixel or
    the name of a ray of a ``LoadedScene``. ``help`` lists the commands; ``quit`` or the end of the
    input continues the program. The test is not changed.
    """
    with contextlib.ExitStack() as stack:
        for surrounding in _surroundings:
            stack.enter_context(surrounding())
        colours = sys.stdout.isatty()
        if isinstance(test, ComputeTest):
            first = [at] if isinstance(at, int) else [] if at is None else at
            position = first if isinstance(first, str) else [*first, 0, 0, 0][: max(3, len(first))]
            test._debug_with(position, _ask, colours)
        elif isinstance(test, LoadedScene):
            test._debug_with(at, _ask, colours)
        elif not isinstance(test, ShaderTest):
            classes = "anyhit.ShaderTest, anyhit.ComputeTest or anyhit.LoadedScene"
            raise _invalid(f"test: expected {classes}, found {type(test).__name__}")
        elif at is not None:
            raise _invalid("at: a ShaderTest has a single invocation")
        else:
            test._debug_with(_ask, colours)


def _invalid(message: str) -> InvalidType:
    return InvalidType(f"error: {message}\n", {"kind": "InvalidArgument", "message": message})


def _ask(answer: str) -> Optional[str]:
    """Prints an answer, and reads the next command; ``None`` at the end of the input."""
    with contextlib.suppress(ImportError):
        import readline  # noqa: F401 (history and keys of the prompt)
    sys.stdout.write(answer)
    sys.stdout.flush()
    while True:
        try:
            line = input(_PROMPT)
        except EOFError:
            print()
            return None
        except KeyboardInterrupt:
            print()
            continue
        if not sys.stdin.isatty():
            # A script reads as a transcript.
            print(line)
        return line


def _no_terminal() -> ContextManager[None]:
    """Surrounds the prompts of processes that have no terminal."""
    message = "pytest-xdist's workers have no terminal for a prompt: run pytest without `-n`"
    raise UnsupportedTool(f"error: {message}\n", {"kind": "UnsupportedTool", "message": message})
