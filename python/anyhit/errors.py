"""The exceptions: one class for each kind of error, ``Trap`` for shaders that misbehave.

``str(error)`` is the whole report, as the command line prints it. Exceptions keep all they say when
they are pickled, so that they pass between processes (pytest-xdist, Ray).
"""

from __future__ import annotations

from typing import Any, Optional

__all__ = [
    "Error",
    "Expectation",
    "Finding",
    "InvalidArgument",
    "InvalidImage",
    "InvalidMesh",
    "InvalidModule",
    "InvalidRecording",
    "InvalidScene",
    "InvalidSource",
    "InvalidType",
    "IoError",
    "Trap",
    "UnsupportedFile",
    "UnsupportedModule",
    "UnsupportedTool",
]

Span = tuple[str, int, int]


class Error(Exception):
    """An error of anyhit. ``Invalid...`` is a mistake in an input, ``Unsupported...`` a gap of
    anyhit or of this machine."""

    def __init__(self, report: str, details: Optional[dict[str, Any]] = None) -> None:
        if not isinstance(report, str) or not isinstance(details, (dict, type(None))):
            raise TypeError("an error is made of a report, a str, and of details, a dict")
        super().__init__(report, details)
        self.report: str = report
        """The whole report, with places and notes."""
        self._details: dict[str, Any] = details or {}

    def __str__(self) -> str:
        return self.report.rstrip()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.report!r})"

    @property
    def kind(self) -> str:
        """The name of the kind in the crate: ``InvalidScene``."""
        return str(self._details.get("kind", type(self).__name__))

    @property
    def message(self) -> str:
        """The one-line message, without places and notes."""
        return str(self._details.get("message", self.report))

    @property
    def notes(self) -> list[str]:
        """The notes: a rule's number, a hint, a value."""
        return list(self._details.get("notes", []))

    @property
    def spans(self) -> list[Span]:
        """The places in files, most important first: file, line and column from 1; 0 where they
        are not known."""
        return [tuple(place) for place in self._details.get("places", [])]

    @property
    def span(self) -> Optional[Span]:
        """The most important place in a file: file, line and column."""
        return self.spans[0] if self.spans else None

    @property
    def file(self) -> Optional[str]:
        """The file of the most important place."""
        return self.span[0] if self.span else None

    @property
    def line(self) -> Optional[int]:
        """The line of the most important place, from 1."""
        return (self.span[1] or None) if self.span else None

    @property
    def column(self) -> Optional[int]:
        """The column of the most important place, from 1."""
        return (self.span[2] or None) if self.span else None

    @property
    def ray(self) -> Optional[int]:
        """Which of the rays of ``Pipeline.trace`` it is about: its row in the arrays."""
        return self._details.get("ray")

    @property
    def others(self) -> list[Error]:
        """Further mistakes that were found in the same run."""
        return [of(report, details) for report, details in self._details.get("others", [])]


class InvalidModule(Error, ValueError):
    """A SPIR-V module breaks a rule of the specification."""


class InvalidScene(Error, ValueError):
    """A scene file, or a scene made of arrays, breaks a rule."""


class InvalidMesh(Error, ValueError):
    """A mesh file cannot be used."""


class InvalidImage(Error, ValueError):
    """An image file cannot be used."""


class InvalidRecording(Error, ValueError):
    """A recording of hits cannot be used."""


class InvalidSource(Error, ValueError):
    """Shader source text did not compile."""


class InvalidArgument(Error, ValueError):
    """An argument makes no sense: an array of another shape, a member that is not there."""


class InvalidType(InvalidArgument, TypeError):
    """An argument is an object of another class."""


class UnsupportedModule(Error, NotImplementedError):
    """A valid instruction, capability or type of a module that anyhit does not run."""


class UnsupportedFile(Error, NotImplementedError):
    """A valid feature of a file that anyhit does not read."""


class UnsupportedTool(Error):
    """A tool that this machine lacks, or a feature that this build lacks."""


class Finding(Error):
    """The sanitizer denies what a shader does, or outputs depend on what is left open."""


class Expectation(Error, AssertionError):
    """An expectation did not hold."""


class IoError(Error, OSError):
    """The operating system refused; ``errno`` is its number."""

    def __init__(self, report: str, details: Optional[dict[str, Any]] = None) -> None:
        super().__init__(report, details)
        self.errno = self._details.get("errno")


class Trap(Error):
    """A shader misbehaved while it ran."""

    @property
    def _trap(self) -> dict[str, Any]:
        return self._details.get("trap") or {}

    @property
    def code(self) -> str:
        """The rule that was broken, by its name in scene files: ``buffer_out_of_bounds``."""
        return str(self._trap.get("code", ""))

    @property
    def launch_id(self) -> tuple[int, int, int]:
        """The launch index; (0, 0, 0) for a ray of ``Pipeline.trace``."""
        x, y, z = self._trap.get("launch_id", (0, 0, 0))
        return (x, y, z)

    @property
    def span(self) -> Optional[Span]:
        """File, line and column of the instruction in the shader's source, where the module has
        debug information."""
        if self._trap.get("file") is None:
            return None
        return (self._trap["file"], self._trap.get("line") or 0, self._trap.get("column") or 0)

    @property
    def stage(self) -> Optional[str]:
        """The stage of the shader: ``ClosestHitKHR``."""
        return self._trap.get("stage")

    @property
    def entry_point(self) -> Optional[str]:
        """The entry point of the shader."""
        return self._trap.get("entry_point")

    @property
    def stack(self) -> list[dict[str, Any]]:
        """The shaders that called it, innermost first: ``stage``, ``entry_point``, ``file``,
        ``line``, ``column``, ``word``."""
        return list(self._trap.get("stack", []))

    @property
    def operands(self) -> Optional[dict[str, Any]]:
        """The values that caused it, by name; ``kind`` says which these are."""
        return self._trap.get("operands")

    @property
    def vuid(self) -> Optional[str]:
        """The valid-usage rule of Vulkan that was broken, where one is cited."""
        return self._trap.get("vuid")


_BY_KIND: dict[str, type[Error]] = {
    "InvalidModule": InvalidModule,
    "InvalidScene": InvalidScene,
    "InvalidMesh": InvalidMesh,
    "InvalidImage": InvalidImage,
    "InvalidRecording": InvalidRecording,
    "InvalidSource": InvalidSource,
    "InvalidArgument": InvalidArgument,
    "UnsupportedModule": UnsupportedModule,
    "UnsupportedFile": UnsupportedFile,
    "UnsupportedTool": UnsupportedTool,
    "Trap": Trap,
    "Finding": Finding,
    "Expectation": Expectation,
    "Io": IoError,
}


def of(report: str, details: dict[str, Any]) -> Error:
    """The exception for a report of the crate."""
    return _BY_KIND.get(str(details.get("kind")), Error)(report, details)
