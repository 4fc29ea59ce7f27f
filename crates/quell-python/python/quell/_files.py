"""EXR sequences to EXR sequences, and what is wrong with one."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from . import _quell
from ._progress import Progress, Teller
from ._settings import sequence_values, warn

Paths = "str | os.PathLike[str] | Iterable[str | os.PathLike[str]]"


@dataclass(frozen=True)
class Report:
    """What became of a job.

    `written`: numbers of the frames that are written. `failed`: those that are not, with the reason. `there_already`: those
    that needed not be made again. `cuts`: first frames of shots that were found. `noise`: of each written frame how much
    noise it had and has, root mean square of the relative error. `seconds` it took. `mapping`: what each pass was taken for.
    """

    written: list[int]
    failed: dict[int, str]
    there_already: list[int]
    cuts: list[int]
    noise: dict[int, tuple[float, float]]
    seconds: float
    mapping: str


def _paths(inputs: Any) -> list[str]:
    if isinstance(inputs, (str, os.PathLike)):
        return [os.fspath(inputs)]
    return [os.fspath(path) for path in inputs]


def _map(wishes: Mapping[str, str] | None) -> list[str]:
    return [f"{role}={name}" for role, name in (wishes or {}).items()]


def denoise_files(
    inputs: Any,
    output: str | os.PathLike[str],
    *,
    frames: Iterable[int] | None = None,
    shot: Iterable[int] | None = None,
    cuts: Iterable[int] | None = None,
    existing: str = "ours",
    strength: float | None = None,
    lookahead: int | None = None,
    preset: str = "sequence",
    settings: Mapping[str, Any] | None = None,
    passes: Iterable[str] | str | None = None,
    layer: str | None = None,
    view: str | None = None,
    roles: Mapping[str, str] | None = None,
    motion_convention: str | None = None,
    renderer: str | None = None,
    noise_pass: bool = False,
    max_memory: int | None = None,
    backend: str = "cpu",
    device: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Does what `quell denoise` does: an EXR sequence of any renderer, filtered.

    Parameters
    ----------
    inputs : path or list of paths
        Files, folders, `shot.####.exr`, `shot.%04d.exr` or globs; one file a frame, or one a pass.
    output : path
        A folder, or a pattern such as `clean/shot.####.exr`. Inputs are never replaced.
    frames, shot, cuts : numbers
        Frames to write (others are read as needed); all frames of the shot, of which none may be missing; first frames of
        new shots.
    existing : str
        What may stand at the output: `ours` (quell's own files are replaced), `skip` (frames whose file exists are left
        alone), `resume` (frames that quell wrote with the same settings are), `overwrite` (everything is replaced).
    passes : list of str, or "beauty"
        Light passes that are written filtered, by role or name.
    layer, view : str
        Only this view layer, this stereo view.
    roles : dict
        What a channel is where its name does not tell: `{"albedo": "tex_color"}`.
    noise_pass : bool
        The expected error of the picture as a further pass.
    max_memory : int
        Bytes; where the job would take more it is filtered in bands of rows, to the same bits.

    The others are as for `quell.Sequence` and `quell.denoise`.

    Raises InputError, FileError where nothing can be done; frames that fail alone are in the report. A KeyboardInterrupt
    leaves whole files, and `existing="resume"` goes on.
    """
    seen: set[str] = set()
    beauty_only = passes == "beauty"
    if isinstance(passes, str) and not beauty_only:
        passes = [passes]
    count, done = 0, 0

    with Teller(progress, "denoise_files") as teller:

        def hear(kind: str, number: int, text: str) -> None:
            nonlocal count, done
            if kind == "begun":
                count = number
            elif kind in ("done", "failed"):
                done += 1
                teller.tell(done, count)
                if kind == "failed":
                    warn(f"frame {number} failed: {text}", set())
            else:
                warn(text, seen)

        report = _quell.denoise_files(
            _paths(inputs), os.fspath(output), preset, sequence_values(settings, strength, lookahead),
            _numbers(frames), _numbers(shot), _numbers(cuts), existing, motion_convention, renderer,
            None if passes is None or beauty_only else [str(p) for p in passes], beauty_only, layer, view, _map(roles),
            noise_pass, max_memory, backend, device, threads, hear,
        )  # fmt: skip
    return Report(**report)


def _numbers(numbers: Iterable[int] | None) -> list[int] | None:
    return None if numbers is None else [int(n) for n in numbers]


def doctor(
    inputs: Any,
    *,
    frames: Iterable[int] | None = None,
    layer: str | None = None,
    view: str | None = None,
    roles: Mapping[str, str] | None = None,
    motion_convention: str | None = None,
    renderer: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> dict[str, Any]:
    """Says what is wrong with an EXR sequence and how to fix it, as data: what `quell doctor --json` says of the frames.

    `findings` is a list of dicts with `check`, `severity` (`fault`, `warning`, `note`), `what`, `evidence`, `figures`,
    `spoils`, `remedy`; `worst` the worst severity or None; `passed`, `not_examined`, `noise`, `frames_found`, `renderer`,
    `mapping`. docs/doctor.md lists every check. What is wrong with files is a finding, no exception.
    """
    with Teller(progress, "doctor") as teller:
        numbers = _numbers(frames)
        found = _quell.doctor(
            _paths(inputs), None if numbers is None else sorted(set(numbers)), layer, view, _map(roles), motion_convention,
            renderer, threads, teller.tell,
        )  # fmt: skip
    diagnosis: dict[str, Any] = json.loads(found)
    return diagnosis
