"""The sequence filter on arrays: one call, or frame by frame."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _quell
from ._arrays import from_bytes, like, ready, to_numpy
from ._errors import Error, InputError
from ._progress import Progress, Teller
from ._settings import sequence_values, warn

#: Arguments that are passes: their role, and the number of channels they may have (0: no axis of channels).
_PLANES = {
    "color": ("beauty", (1, 3, 4)),
    "albedo": ("albedo", (1, 3)),
    "normal": ("normal", (3,)),
    "depth": ("depth", (0, 1)),
    "motion": ("motion", (2, 4)),
    "position": ("position", (3,)),
    "variance": ("variance", (0, 1, 3)),
    "roughness": ("roughness", (0, 1)),
}


#: Name, role (None: by its name), array.
_Arrays = list[tuple[str, str | None, Any]]


@dataclass(frozen=True)
class Clean:
    """A frame that came out.

    `color` and `passes` have shapes, types and kinds as they were pushed, `noise` the expected error of the picture,
    (height, width) float32 in its units, or None where the stage that estimates it is off. `color` is None where no color was
    pushed.
    """

    number: int
    color: Any
    passes: dict[str, Any]
    noise: np.ndarray | None


def _check(name: str, array: np.ndarray, channels: tuple[int, ...]) -> np.ndarray:
    """(height, width, channels), whatever the pass has."""
    flat = 0 in channels
    counted = [c for c in channels if c]
    wanted = "(height, width)" if flat else f"(height, width, {' or '.join(map(str, counted))})"
    if flat and array.ndim == 2:
        return array[:, :, np.newaxis]
    if array.ndim != 3 or array.shape[2] not in counted:
        raise InputError(f"{name}: shape {array.shape}, expected {wanted}")
    return array


class Sequence:
    """A sequence whose frames are pushed in order; clean ones come out as soon as their window is full.

    A frame is filtered with `lookahead` frames before and after it (11 by default): the first comes out when as many have
    followed, the last ones with `flush()`. Frames may come out a call later than that, since two frames decide what motion
    vectors and light passes mean. Holds about `lookahead` frames in half precision; nothing of the arrays that were pushed.

    Parameters
    ----------
    size : (height, width), optional
        Extent of every frame; else the first frame's.
    lookahead : int, optional
        Frames before and after that take part. Fewer: less memory, less delay, more noise. 0: only frames before.
    preset : str
        `sequence`, or `sequence-short`: a window of 4 frames each way, less memory, more noise.
    strength : float, optional
        How much noise is removed: 1 as much as pays, less leaves grain (0 is the input), up to 4 smooths further.
    settings : dict, optional
        Any parameter by name; see `quell.parameters()`.
    motion_convention : str, optional
        What vectors mean. `pixels`: the surface lies at pixel + motion in the frame before, x right, y down (and with two
        further numbers at pixel + those in the next one). `blender`, `arnold`, `renderman`, `nuke`, `uv`: as they write
        them; `auto`: found out from two frames; `none`: not used. By default `pixels` for the argument `motion`, and the
        renderer's own for motion among `passes`.
    renderer : str, optional
        Whose names and conventions the passes have: `blender`, `arnold`, `renderman`, `vray`, `pbrt`, `mitsuba`, `nuke`,
        `quell`, `any`; by default told from the names.
    cuts : list of int, optional
        Numbers of the first frames of new shots; by default found from what frames show.
    backend : str
        `cpu`: the same bits on every machine. `gpu`, `auto` (a GPU where there is one), `reference` (slow).
    device : str, optional
        The GPU, by a part of its name.
    threads : int, optional
        By default as many as the machine has.

    A sequence is used by one thread at a time; several may work at once. After an exception that is not an `InputError` of
    the frame just pushed (a KeyboardInterrupt among them), what was inside is given up and the next frame begins anew.
    """

    def __init__(
        self,
        size: tuple[int, int] | None = None,
        *,
        lookahead: int | None = None,
        preset: str = "sequence",
        strength: float | None = None,
        settings: Mapping[str, Any] | None = None,
        motion_convention: str | None = None,
        renderer: str | None = None,
        cuts: list[int] | None = None,
        backend: str = "cpu",
        device: str | None = None,
        threads: int | None = None,
    ) -> None:
        if size is not None:
            size = (int(size[0]), int(size[1]))
            if min(size) < 1:
                raise InputError(f"size: {size}; both extents must be at least 1")
        self._size = self._extent = size
        values = sequence_values(settings, strength, lookahead)
        self._options = (preset, values, renderer, cuts, backend, device, threads)
        self._motion = motion_convention
        self._frames: Any = None
        #: Of each pass: its number of axes, and how an array becomes one of its kind.
        self._kinds: dict[str, tuple[int, Callable[[np.ndarray], Any]]] = {}
        self._next: int | None = None
        self._seen: set[str] = set()
        self._mapping = ""
        self._lock = threading.Lock()
        # What can be checked without a frame is checked now.
        self._lookahead = int(self._start(motion_convention).lookahead())

    def _start(self, motion: str | None) -> Any:
        preset, settings, renderer, cuts, backend, device, threads = self._options
        cuts = None if cuts is None else list(cuts)
        return _quell.Frames(preset, settings, motion, renderer, cuts, backend, device, threads)

    @property
    def lookahead(self) -> int:
        """How many frames must follow one before it comes out."""
        return self._lookahead

    @property
    def mapping(self) -> str:
        """What each pass was taken for and why, a line each; empty before the first frame came out."""
        return self._mapping

    def push(
        self,
        color: Any = None,
        *,
        albedo: Any = None,
        normal: Any = None,
        depth: Any = None,
        motion: Any = None,
        position: Any = None,
        variance: Any = None,
        roughness: Any = None,
        passes: Mapping[str, Any] | None = None,
        camera: Any = None,
        number: int | None = None,
    ) -> list[Clean]:
        """Takes the next frame and returns those that are ready: none or one as a rule, more after a cut.

        Arrays are as `quell.denoise` takes them for one frame. `number` is the frame's number, by default the last one's and
        one more; a gap begins a new shot, and what waited comes out. Numbers rise until `flush()`.
        """
        given = dict(
            color=color, albedo=albedo, normal=normal, depth=depth, motion=motion, position=position,
            variance=variance, roughness=roughness,
        )  # fmt: skip
        arrays: _Arrays = [(name, _PLANES[name][0], value) for name, value in given.items() if value is not None]
        if passes is not None and not isinstance(passes, Mapping):
            raise TypeError(f"passes: {type(passes).__qualname__}; a dict of names and arrays is needed")
        arrays += [(str(name), None, value) for name, value in (passes or {}).items()]
        if not arrays:
            raise InputError("color: a frame needs color, or light passes in passes")
        return self._push(arrays, camera, number)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._lock.acquire(blocking=False):
            raise Error("this sequence is being used by another thread; each needs one of its own")
        try:
            yield
        finally:
            self._lock.release()

    def _push(self, arrays: _Arrays, camera: Any, number: int | None) -> list[Clean]:
        with self._alone():
            return self._push_alone(arrays, camera, number)

    def _push_alone(self, arrays: _Arrays, camera: Any, number: int | None) -> list[Clean]:
        ready_made = []
        size = self._extent
        kinds = {}
        for name, role, value in arrays:
            array = to_numpy(name, value)
            channels = _PLANES[name][1] if role else (0, 1, 2, 3, 4)
            full = _check(name, array, channels)
            kinds[name] = (array.ndim, like(value))
            if size is None:
                size = full.shape[:2]
                if min(size) < 1:
                    raise InputError(f"{name}: shape {array.shape} has no pixels")
            if full.shape[:2] != size:
                raise InputError(f"{name}: shape {array.shape}, but the frame is {size[0]} high and {size[1]} wide")
            ready_made.append((name, role, *ready(name, full)))
        assert size is not None, "there is an array"
        if number is None:
            number = 1 if self._next is None else self._next
        elif isinstance(number, bool) or not isinstance(number, (int, np.integer)):
            raise InputError(f"number: {number!r} is no whole number")
        number = int(number)
        if self._frames is None:
            by_argument = any(name == "motion" and role for name, role, _ in arrays)
            self._frames = self._start(self._motion or ("pixels" if by_argument else None))
            self._kinds = kinds
        out: list[Clean] = []
        try:
            decided = self._frames.push(number, size[0], size[1], ready_made, _matrix(camera), self._emit(out))
        except InputError:
            if self._next is None:
                # Nothing was taken yet: another frame may begin otherwise.
                self._frames = None
            raise
        except BaseException:
            self._forget()
            raise
        self._extent, self._next = size, number + 1
        self._decide(decided)
        return out

    def flush(self) -> list[Clean]:
        """The end of the sequence: the frames that are inside come out, and the next one pushed begins a new sequence."""
        out: list[Clean] = []
        with self._alone():
            if self._frames is not None:
                try:
                    self._decide(self._frames.flush(self._emit(out)))
                finally:
                    self._forget()
        return out

    def _forget(self) -> None:
        if self._frames is not None:
            self._frames.reset()
        self._frames, self._next, self._extent = None, None, self._size

    def _decide(self, decided: tuple[str, list[str], list[str]] | None) -> None:
        if decided is None:
            return
        self._mapping, warnings, others = decided
        for text in warnings:
            warn(text, self._seen)
        if others:
            names = ", ".join(others)
            warn(f"nothing is known to do with these passes, which are left out: {names}", self._seen)

    def _emit(self, out: list[Clean]) -> Any:
        kinds = self._kinds

        def emit(
            number: int,
            height: int,
            width: int,
            passes: list[tuple[str, int, bool, bytearray]],
            noise: bytearray | None,
            notes: list[str],
        ) -> None:
            color, found = None, {}
            for name, channels, halves, data in passes:
                axes, kind = kinds[name]
                array = from_bytes(data, (height, width, channels), halves)
                if axes == 2:
                    array = array[:, :, 0]
                array = kind(array)
                if name == "color":
                    color = array
                else:
                    found[name] = array
            error = None if noise is None else from_bytes(noise, (height, width), False)
            for text in notes:
                warn(text, self._seen)
            clean = Clean(number, color, found, error)
            out.append(clean)
            if self._hear is not None:
                self._hear(clean)

        return emit

    #: Called with each frame that comes out, at once.
    _hear: Any = None


def _matrix(camera: Any) -> list[float] | None:
    """Clip from world as the compiled part takes it, column-major."""
    if camera is None:
        return None
    matrix = getattr(camera, "clip_from_world", camera)
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape != (4, 4) or not np.isfinite(array).all():
        raise InputError(f"camera: shape {array.shape}; a finite 4x4 matrix that takes world points to clip space is needed")
    return [float(v) for v in array.T.reshape(16)]


def denoise(
    color: Any = None,
    *,
    albedo: Any = None,
    normal: Any = None,
    depth: Any = None,
    motion: Any = None,
    position: Any = None,
    variance: Any = None,
    roughness: Any = None,
    passes: Mapping[str, Any] | None = None,
    camera: Any = None,
    numbers: list[int] | None = None,
    lookahead: int | None = None,
    preset: str = "sequence",
    strength: float | None = None,
    settings: Mapping[str, Any] | None = None,
    motion_convention: str | None = None,
    renderer: str | None = None,
    cuts: list[int] | None = None,
    backend: str = "cpu",
    device: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Any:
    """Removes the noise from one frame, or from a sequence.

    Every array is one frame, (height, width, channels), or a sequence, (frames, height, width, channels); float16, float32 or
    float64 (which comes out as float32); from numpy, any buffer, or whatever speaks DLPack on the CPU (torch, jax, Dr.Jit).
    Light is scene-linear. What is not given is done without, as `quell denoise` does with such files, and a `QuellWarning`
    says what that costs.

    Parameters
    ----------
    color : (.., 3 or 4)
        The noisy picture, with its alpha where there is one.
    albedo : (.., 3)
        Colour of the surface, 0..1; textures in it stay sharp. May be noisy.
    normal : (.., 3)
        Shading normal in world space; (0, 0, 0) where there is no surface.
    depth : (..)
        Distance along the camera's axis, > 0; infinite (or 0) where there is no surface.
    motion : (.., 2)
        Where the surface was in the frame before, relative to the pixel, in pixels, x right, y down; (.., 4) with where it
        will be in the next one. Other conventions: `motion_convention`. Without it, and without `camera` or `position`, the
        frames of a sequence are filtered one by one.
    position : (.., 3)
        World position of the surface.
    variance : (..) or (.., 3)
        Variance of the pixels' means.
    roughness : (..)
        Perceptual roughness, 0..1.
    passes : dict of arrays
        Light passes and what belongs to them, by a renderer's name (`DiffDir`, `specular_indirect`, ...), by quell's
        (`matte_direct`, `glossy_indirect`, `emission`, ...), or light groups. Each is filtered, and the filtered ones add up
        to the filtered `color` by the rule by which they added up before.
    camera : (4, 4), (frames, 4, 4) or a list of quell.Camera
        Clip from world for column vectors, x right, y up.
    numbers : list of int
        Numbers of the frames; a gap begins a new shot. By default 1, 2, 3 and so on.
    progress : callable or True
        Called with (done, of) after each frame; True: a bar of tqdm where that is installed, else lines.

    The others are as for `quell.Sequence`.

    Returns
    -------
    array, or (array, dict)
        Of the shape, type and kind of `color`. With `passes` also a dict of the passes that were filtered; `color` is None
        where none was given.

    >>> import numpy as np, quell
    >>> noisy = np.random.default_rng(1).gamma(1.0, 1.0, (24, 32, 3)).astype("float32")
    >>> clean = quell.denoise(noisy, normal=np.tile(np.float32([0, 0, 1]), (24, 32, 1)))
    >>> clean.shape, bool(clean.std() < 0.2 * noisy.std())
    ((24, 32, 3), True)
    """
    given = dict(
        color=color, albedo=albedo, normal=normal, depth=depth, motion=motion, position=position,
        variance=variance, roughness=roughness,
    )  # fmt: skip
    given = {name: value for name, value in given.items() if value is not None}
    if passes is not None and not isinstance(passes, Mapping):
        raise TypeError(f"passes: {type(passes).__qualname__}; a dict of names and arrays is needed")
    kinds: dict[str, Any] = {}
    arrays: dict[tuple[str, str | None], np.ndarray] = {}
    for name, role, value in [(n, _PLANES[n][0], v) for n, v in given.items()] + [
        (str(n), None, v) for n, v in (passes or {}).items()
    ]:
        arrays[(name, role)] = to_numpy(name, value)
        kinds[name] = like(value)
    if not arrays:
        raise InputError("color: a frame needs color, or light passes in passes")
    frames = _frames(arrays, _PLANES)
    cameras = _cameras(camera, frames)
    if numbers is None:
        numbers = list(range(1, (frames or 1) + 1))
    elif len(numbers) != (frames or 1) or len(set(numbers)) != len(numbers):
        raise InputError(f"numbers: {len(numbers)} of {len(set(numbers))} kinds; {frames or 1} that differ are needed")
    elif list(numbers) != sorted(numbers):
        raise InputError(f"numbers: {list(numbers)[:8]}; frames come in ascending order")
    sequence = Sequence(
        None, lookahead=lookahead, preset=preset, strength=strength, settings=settings,
        motion_convention=motion_convention, renderer=renderer, cuts=cuts, backend=backend, device=device, threads=threads,
    )  # fmt: skip
    results: dict[str, np.ndarray] = {}
    count = frames or 1
    with Teller(progress, "denoise") as teller:
        done = iter(range(count))

        def hear(clean: Clean) -> None:
            at = next(done)
            for name, value in [("color", clean.color), *clean.passes.items()]:
                if value is None:
                    continue
                if frames is None:
                    results[name] = value
                    continue
                if name not in results:
                    results[name] = np.empty((count, *value.shape), value.dtype)
                results[name][at] = value
            teller.tell(at + 1, count)

        sequence._hear = hear
        for at in range(count):
            one = [(n, r, a if frames is None else a[at]) for (n, r), a in arrays.items()]
            sequence._push(one, cameras[at], int(numbers[at]))
        sequence.flush()
    made = {name: kinds[name](array) for name, array in results.items()}
    picture = made.pop("color", None)
    return picture if passes is None else (picture, made)


def _frames(arrays: dict[tuple[str, str | None], np.ndarray], planes: dict[str, tuple[str, tuple[int, ...]]]) -> int | None:
    """How many frames; None for one without an axis of frames. Every array has it, or none."""
    (first, role), array = next(iter(arrays.items()))
    channels = planes[first][1] if role else (0, 1, 2, 3, 4)
    with_axis = array.ndim == 4 or (array.ndim == 3 and 0 in channels and role is not None)
    if role is None and array.ndim == 3:
        with_axis = array.shape[2] > 4
    frames = array.shape[0] if with_axis else None
    if frames == 0:
        raise InputError(f"{first}: shape {array.shape} has no frames")
    for (name, _), other in arrays.items():
        found = other.shape[0] if frames is not None and other.ndim >= 3 else None
        if frames is not None and found != frames:
            raise InputError(f"{name}: shape {other.shape}, but {first} has {frames} frames")
        if frames is None and other.ndim > 3:
            raise InputError(f"{name}: shape {other.shape}, but {first} is one frame of shape {array.shape}")
    return frames


def _cameras(camera: Any, frames: int | None) -> list[Any]:
    count = frames or 1
    if camera is None:
        return [None] * count
    if isinstance(camera, (list, tuple)) and camera and hasattr(camera[0], "clip_from_world"):
        cameras = list(camera)
    elif hasattr(camera, "clip_from_world"):
        cameras = [camera] * count
    else:
        array = np.asarray(camera)
        cameras = [array] * count if array.ndim == 2 else list(array)
    if len(cameras) != count:
        raise InputError(f"camera: {len(cameras)} cameras for {count} frames")
    return cameras
