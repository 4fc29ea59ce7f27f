"""The compiled part of the package: no promise, use what `quell` itself names."""

from collections.abc import Callable
from typing import Any

_Pass = tuple[str, str | None, Any, bool]
_Camera = tuple[list[float], list[float], list[float]]
_Decided = tuple[str, list[str], list[str]] | None
_Emit = Callable[[int, int, int, list[tuple[str, int, bool, bytearray]], bytearray | None, list[str]], None]

class Frames:
    def __init__(
        self,
        preset: str,
        settings: list[tuple[str, str]],
        motion: str | None,
        renderer: str | None,
        cuts: list[int] | None,
        backend_name: str,
        device: str | None,
        threads: int | None,
    ) -> None: ...
    def lookahead(self) -> int: ...
    def push(
        self, number: int, height: int, width: int, passes: list[_Pass], camera: list[float] | None, emit: _Emit
    ) -> _Decided: ...
    def flush(self, emit: _Emit) -> _Decided: ...
    def reset(self) -> None: ...

class Realtime:
    def __init__(
        self,
        height: int,
        width: int,
        preset: str,
        settings: list[tuple[str, str]],
        backend_name: str,
        device: str | None,
        threads: int | None,
    ) -> None: ...
    def denoise(self, index: int, camera: _Camera, previous: _Camera | None, planes: list[_Pass]) -> dict[str, Any]: ...
    def reset(self) -> None: ...

def finish() -> None: ...
def perspective(
    position: list[float], forward: list[float], up: list[float], vertical_fov: float, aspect: float
) -> list[float]: ...
def parameters(preset: str) -> list[tuple[str, str, str, str, str, str, str, str]]: ...
def version() -> str: ...
def denoise_files(*arguments: Any) -> dict[str, Any]: ...
def doctor(*arguments: Any) -> str: ...
def run_command(arguments: list[str], program: str) -> int: ...
