"""Progress: a callback, or a bar where tqdm is there."""

from __future__ import annotations

from typing import Any, Callable

#: `None` or False: nothing. True: a bar of tqdm, or lines on standard error. Else called with (done, of).
Progress = Any


class Teller:
    """Tells progress in one way, whatever was asked for. Used as a context."""

    def __init__(self, progress: Progress, what: str) -> None:
        self._bar: Any = None
        self._call: Callable[[int, int], Any] | None = None
        self._what = what
        if progress is None or progress is False:
            return
        if progress is True:
            try:
                from tqdm.auto import tqdm  # type: ignore[import-untyped, import-not-found, unused-ignore]

                self._bar = tqdm(desc=what, unit="frame")
            except ImportError:
                self._call = self._line
        elif callable(progress):
            self._call = progress
        else:
            raise TypeError(f"progress: {progress!r} is neither True, False, None nor callable")

    def __enter__(self) -> Teller:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def tell(self, done: int, of: int) -> None:
        if self._bar is not None:
            self._bar.total = of
            self._bar.update(done - self._bar.n)
        elif self._call is not None:
            self._call(done, of)

    def _line(self, done: int, of: int) -> None:
        import sys

        print(f"quell: {self._what} {done} of {of}", file=sys.stderr)
