"""The real-time filter: two signals, feature buffers without noise, a camera."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _quell
from ._arrays import from_bytes, like, to_numpy
from ._errors import Error, InputError
from ._settings import values

#: Planes of a frame and their channels (0: no axis of channels).
_PLANES = {
    "direct": 3, "matte": 3, "glossy": 3, "direct_matte": 3, "direct_glossy": 3, "matte_weight": 3, "glossy_weight": 3,
    "depth": 0, "normal": 3, "roughness": 0, "motion": 2, "glossy_hit_distance": 0, "surface_id": 0, "confidence": 0,
}  # fmt: skip


@dataclass(frozen=True)
class Camera:
    """The camera of a frame.

    `clip_from_world`: (4, 4), takes world points (column vectors) to clip space, x right, y up; only rows x, y and w are
    used. `position`: of the eye in world space. `jitter`: where samples lie, in pixels from the pixel centres; where it is
    not 0, preset `quality` anti-aliases the picture over time.
    """

    clip_from_world: np.ndarray
    position: tuple[float, float, float]
    jitter: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def perspective(
        position: tuple[float, float, float],
        forward: tuple[float, float, float],
        up: tuple[float, float, float] = (0.0, 1.0, 0.0),
        *,
        vertical_fov: float,
        aspect: float,
    ) -> Camera:
        """A perspective camera: `forward` and `up` in world space, `vertical_fov` in degrees, `aspect` width over height."""
        if not 0.0 < vertical_fov < 180.0:
            raise InputError(f"vertical_fov: {vertical_fov}; degrees between 0 and 180 are needed")
        if not aspect > 0.0:
            raise InputError(f"aspect: {aspect}; width over height is needed")
        flat = _quell.perspective(list(position), list(forward), list(up), math.radians(vertical_fov), aspect)
        return Camera(np.array(flat, dtype=np.float64).reshape(4, 4).T, position)

    def _flat(self, name: str) -> tuple[list[float], list[float], list[float]]:
        matrix = np.asarray(self.clip_from_world, dtype=np.float64)
        if matrix.shape != (4, 4):
            raise InputError(f"{name}: clip_from_world of shape {matrix.shape}, expected (4, 4)")
        return matrix.T.reshape(16).tolist(), [float(v) for v in self.position], [float(v) for v in self.jitter]


@dataclass(frozen=True)
class Denoised:
    """What the real-time filter made of a frame.

    `color`: the picture, (height, width, 3), anti-aliased over time where frames are jittered. `matte` and `glossy`: the filtered signals without their weights, or None.
    `confidence`: (height, width), 0..1, 0 where there was no history. `had_history`: whether any was used.
    """

    color: Any
    matte: Any
    glossy: Any
    confidence: Any
    had_history: bool


class Denoiser:
    """The real-time filter (after Mara et al. 2017), with its history between calls.

    Parameters
    ----------
    size : (height, width)
    preset, settings
        `quality` or `paper` (as published in 2017), and any parameter by name; see `quell.parameters("quality")`.
    backend, device, threads
        As for `quell.Sequence`.
    """

    def __init__(
        self,
        size: tuple[int, int],
        *,
        preset: str = "quality",
        settings: Mapping[str, Any] | None = None,
        backend: str = "cpu",
        device: str | None = None,
        threads: int | None = None,
    ) -> None:
        self.size = (int(size[0]), int(size[1]))
        if min(self.size) < 1:
            raise InputError(f"size: {self.size}; both extents must be at least 1")
        self._inner = _quell.Realtime(*self.size, preset, values(settings), backend, device, threads)
        self._index = 0
        self._camera: Camera | None = None
        self._lock = threading.Lock()

    def denoise(
        self,
        camera: Camera,
        *,
        matte: Any = None,
        glossy: Any = None,
        direct: Any = None,
        direct_matte: Any = None,
        direct_glossy: Any = None,
        matte_weight: Any = None,
        glossy_weight: Any = None,
        depth: Any = None,
        normal: Any = None,
        roughness: Any = None,
        motion: Any = None,
        glossy_hit_distance: Any = None,
        surface_id: Any = None,
        confidence: Any = None,
        previous_camera: Camera | None = None,
        index: int | None = None,
    ) -> Denoised:
        """Filters the next frame.

        Light is scene-linear, (height, width, 3); `matte` and `glossy` are indirect light without their weights (the albedo
        and its like), `direct` needs no filter, `direct_matte` and `direct_glossy` are noisy direct light. `depth` lies along
        the camera's axis, `normal` is in world space, `motion` leads to the frame before in pixels, x right, y down
        (previous = current + motion). What is left out has the default that `quell::Frame` names. `index`: a number that does
        not follow is a cut; by default the last one's and one more. `previous_camera`: by default that of the last call.
        """
        given = {
            name: value
            for name, value in dict(
                direct=direct, matte=matte, glossy=glossy, direct_matte=direct_matte, direct_glossy=direct_glossy,
                matte_weight=matte_weight, glossy_weight=glossy_weight, depth=depth, normal=normal, roughness=roughness,
                motion=motion, glossy_hit_distance=glossy_hit_distance, surface_id=surface_id, confidence=confidence,
            ).items()
            if value is not None
        }  # fmt: skip
        if not isinstance(camera, Camera):
            raise TypeError(f"camera: {type(camera).__qualname__}; a quell.Camera is needed")
        height, width = self.size
        planes: list[tuple[str, str | None, Any, bool]] = []
        for name, value in given.items():
            ids = name == "surface_id"
            array = np.asarray(value) if ids else to_numpy(name, value)
            if ids and array.dtype.kind not in "ui":
                raise InputError(f"surface_id: numbers of type {array.dtype}; whole numbers are needed")
            if ids:
                # Which numbers they are does not matter, and float32 holds 2^24 of them.
                array = np.unique(array, return_inverse=True)[1].reshape(array.shape)
            wanted = (height, width, _PLANES[name]) if _PLANES[name] else (height, width)
            if array.shape != wanted:
                raise InputError(f"{name}: shape {array.shape}, expected {wanted}")
            planes.append((name, None, np.asarray(array, dtype="=f4").reshape(height, width, -1), False))
        if not self._lock.acquire(blocking=False):
            raise Error("this denoiser is being used by another thread; each needs one of its own")
        try:
            index = self._index if index is None else int(index)
            previous = previous_camera or self._camera
            before = None if previous is None else previous._flat("previous_camera")
            made = self._inner.denoise(index, camera._flat("camera"), before, planes)
            self._index, self._camera = index + 1, camera
        finally:
            self._lock.release()
        kind = like(next(iter(given.values()))) if given else like(np.empty(0))

        def array_of(name: str, *channels: int) -> Any:
            data = made[name]
            return None if data is None else kind(from_bytes(data, (height, width, *channels), False))

        return Denoised(
            array_of("color", 3), array_of("matte", 3), array_of("glossy", 3), array_of("confidence"), made["had_history"]
        )

    def reset(self) -> None:
        """Forgets history: for cuts that the index does not show."""
        self._inner.reset()
        self._camera = None
