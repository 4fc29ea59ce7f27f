"""Arrays of any framework in, the same kind out.

Everything that has numpy's array, the buffer protocol or DLPack on the CPU is taken. What comes out is of the kind of the
first array: a torch tensor for a torch tensor, and so on.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any, Callable

import numpy as np

from ._errors import InputError

#: DLPack's numbers of devices whose memory this process can read.
_ON_CPU = {1: "CPU", 3: "CUDA's pinned memory", 11: "ROCm's pinned memory"}
_DEVICES = {2: "CUDA", 4: "OpenCL", 7: "Vulkan", 8: "Metal", 10: "ROCm", 13: "CUDA's managed memory", 14: "oneAPI"}

#: How each framework copies to the CPU.
_COPIES = {
    "torch": "{name}.cpu()",
    "cupy": "cupy.asnumpy({name})",
    "jax": "jax.device_put({name}, jax.devices('cpu')[0])",
    "jaxlib": "jax.device_put({name}, jax.devices('cpu')[0])",
    "drjit": "{name}.numpy()",
    "mitsuba": "{name}.numpy()",
    "tensorflow": "tf.identity({name}) on the device '/CPU:0'",
}


def _framework(value: Any) -> str:
    return type(value).__module__.split(".")[0]


def to_numpy(name: str, value: Any) -> np.ndarray:
    """The array as numpy sees it, without a copy where the layout allows it.

    Raises TypeError where it is no array, and InputError where it lies on a GPU or has numbers that are no floats.
    """
    if isinstance(value, np.ndarray):
        array = value
    elif hasattr(value, "__dlpack__"):
        array = _from_dlpack(name, value)
    elif hasattr(value, "__cuda_array_interface__"):
        raise _on_device(name, value, "CUDA")
    elif hasattr(value, "__array_interface__") or hasattr(value, "__array__"):
        array = np.asarray(value)
    else:
        try:
            array = np.asarray(memoryview(value))
        except TypeError:
            raise TypeError(
                f"{name}: {type(value).__module__}.{type(value).__qualname__} is no array; "
                "numpy arrays, buffers and whatever speaks DLPack are taken"
            ) from None
    if array.dtype.kind != "f" or array.dtype.itemsize not in (2, 4, 8):
        raise InputError(f"{name}: numbers of type {array.dtype}; float16, float32 and float64 are taken")
    return array


def _from_dlpack(name: str, value: Any) -> np.ndarray:
    if getattr(value, "requires_grad", False) and hasattr(value, "detach"):
        value = value.detach()
    try:
        device = int(value.__dlpack_device__()[0])
    except Exception:  # noqa: BLE001 - a framework may raise anything here; the next call says what is wrong
        device = 1
    if device not in _ON_CPU:
        raise _on_device(name, value, _DEVICES.get(device, f"DLPack's device {device}"))
    try:
        return np.from_dlpack(value)
    except (BufferError, RuntimeError, TypeError, ValueError) as error:
        raise InputError(f"{name}: {_framework(value)} does not hand this array over: {error}") from error


def _on_device(name: str, value: Any, device: str) -> InputError:
    copy = _COPIES.get(_framework(value), "its framework's copy to the CPU").format(name=name)
    return InputError(f"{name}: this array lies on {device}; arrays are filtered on the CPU's memory, so copy it first: {copy}")


def _same(array: np.ndarray) -> Any:
    return array


def like(value: Any) -> Callable[[np.ndarray], Any]:
    """How a numpy array becomes one of the kind of `value`."""
    framework = _framework(value)
    made: Callable[[np.ndarray], Any] = _same
    if isinstance(value, memoryview):
        return lambda array: array.data
    elif framework == "torch":
        made = sys.modules["torch"].from_numpy
    elif framework in ("jax", "jaxlib"):
        made = importlib.import_module("jax.numpy").asarray
    elif framework in ("drjit", "mitsuba"):
        made = type(value)
    elif not isinstance(value, np.ndarray) and hasattr(value, "__array_namespace__"):
        made = value.__array_namespace__().from_dlpack
    return made


def ready(name: str, array: np.ndarray) -> tuple[np.ndarray, bool]:
    """(height, width, channels) as the compiled part takes it: 32-bit floats, or 16-bit words that hold halves."""
    if array.dtype.itemsize == 2:
        return np.require(array, "=f2", ["ALIGNED"]).view(np.uint16), True
    with np.errstate(over="ignore"):
        # float64 beyond float32's range becomes an infinity, which counts as no number.
        return np.require(array, "=f4", ["ALIGNED"]), False


def from_bytes(data: bytearray, shape: tuple[int, ...], halves: bool) -> np.ndarray:
    return np.frombuffer(data, dtype=np.float16 if halves else np.float32).reshape(shape)
