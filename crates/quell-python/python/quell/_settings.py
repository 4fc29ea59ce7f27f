"""Settings by name, from the one table of all parameters."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from . import _quell
from ._errors import InputError, QuellWarning

#: What sentences of the command say, in the words of this package.
_WORDS = (
    ("--motion", "motion_convention"),
    ("--map", "passes"),
    ("`quell doctor` with the same frames", "quell.doctor"),
)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a filter.

    `name` is `stage.parameter`; `default`, `range` and `unit` are text; `higher` and `lower` say what more and less of it
    does; `source` where it comes from.
    """

    name: str
    default: str
    range: str
    unit: str
    doc: str
    higher: str
    lower: str
    source: str


def parameters(preset: str = "sequence") -> list[Parameter]:
    """Every parameter of a preset in the order of its stages: `sequence` and `sequence-short` for `denoise`, `Sequence` and
    `denoise_files`, `paper` and `quality` for `Denoiser`.

    >>> import quell
    >>> next(p for p in quell.parameters() if p.name == "blend.strength").default
    '1'
    """
    return [Parameter(*row) for row in _quell.parameters(preset)]


def as_text(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, (int, float, str)):
        return str(value)
    raise InputError(f"settings: {name} = {value!r}; a number, a bool or text is needed")


def values(settings: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if settings is None:
        return []
    if not isinstance(settings, Mapping):
        raise TypeError(f"settings: {type(settings).__qualname__}; a dict of names and values is needed")
    return [(str(name), as_text(name, value)) for name, value in settings.items()]


def sequence_values(
    settings: Mapping[str, Any] | None, strength: float | None, lookahead: int | None
) -> list[tuple[str, str]]:
    """What is set, in the order in which it counts: `settings` last."""
    found: list[tuple[str, str]] = []
    if lookahead is not None:
        if isinstance(lookahead, bool) or not isinstance(lookahead, int) or lookahead < 0:
            raise InputError(f"lookahead: {lookahead!r}; a whole number of frames, 0 or more, is needed")
        if lookahead == 0:
            found.append(("gather.future", "off"))
        else:
            steady = min(3, lookahead // 3)
            found += [("stabilise.frames", str(steady)), ("gather.frames", str(lookahead - steady))]
    if strength is not None:
        found.append(("blend.strength", as_text("strength", strength)))
    return found + values(settings)


def warn(text: str, seen: set[str]) -> None:
    """Warns, at the line of the user's that called the package; of what differs in numbers only once."""
    plain = "".join(c for c in text if not c.isdigit())
    if plain in seen:
        return
    seen.add(plain)
    for theirs, ours in _WORDS:
        text = text.replace(theirs, ours)
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).split(".")[0] == "quell":
        level, frame = level + 1, frame.f_back
    warnings.warn(text, QuellWarning, stacklevel=level)
