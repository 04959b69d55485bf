"""Requests of services as bytes, which no client of ROS sends: by the middleware's own functions."""

import ctypes
import importlib
import struct
from ctypes import POINTER, Structure, byref, c_bool, c_char_p, c_int, c_size_t, c_uint64, c_void_p
from functools import cache
from random import Random
from typing import Any

from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.utilities import get_rmw_implementation_identifier


class _Qos(Structure):
    """rmw_qos_profile_t, of rmw/types.h."""

    _fields_ = [
        ("history", c_int),
        ("depth", c_size_t),
        ("reliability", c_int),
        ("durability", c_int),
        ("deadline", c_uint64 * 2),
        ("lifespan", c_uint64 * 2),
        ("liveliness", c_int),
        ("lease", c_uint64 * 2),
        ("plain_name", c_bool),
    ]


class _Options(Structure):
    """rmw_publisher_options_t."""

    _fields_ = [("payload", c_void_p), ("unique", c_int)]


class _Bytes(Structure):
    """rmw_serialized_message_t."""

    _fields_ = [("buffer", c_char_p), ("length", c_size_t), ("capacity", c_size_t), ("allocator", c_void_p * 5)]


@cache
def _library(name: str) -> Any:
    return ctypes.CDLL(f"lib{name}.so")


def _function(library: str, name: str, result: Any, *arguments: Any) -> Any:
    found = getattr(_library(library), name)
    found.restype, found.argtypes = result, arguments
    return found


def _rmw(name: str, result: Any, *arguments: Any) -> Any:
    return _function(get_rmw_implementation_identifier(), name, result, *arguments)


class RawRequests:
    """Sends bytes to a service, as its requests.

    Parameters
    ----------
    node : Node
    kind : type
        Of the request, such as `SetParameters.Request`; of an action `Scan.Impl.SendGoalService.Request`.
    service : str
        Full name.
    """

    def __init__(self, node: Node, kind: type, service: str) -> None:
        package, folder = kind.__module__.split(".")[:2]
        support = f"rosidl_typesupport_c__get_message_type_support_handle__{package}__{folder}__{kind.__name__}"
        self._node = _function("rcl", "rcl_node_get_rmw_handle", c_void_p, c_void_p)(node.handle.pointer)
        # Kept last 1000, reliable, volatile.
        qos = _Qos(history=1, depth=1000, reliability=1, durability=2, plain_name=True)
        create = _rmw("rmw_create_publisher", c_void_p, c_void_p, c_void_p, c_char_p, POINTER(_Qos), c_void_p)
        self._publisher = create(
            self._node,
            _function(f"{package}__rosidl_typesupport_c", support, c_void_p)(),
            f"rq{service}Request".encode(),
            byref(qos),
            byref(_Options()),
        )
        assert self._publisher, f"no requests can be sent to {service}"

    @property
    def heard(self) -> bool:
        """Whether the service is there."""
        count = c_size_t()
        ask = _rmw("rmw_publisher_count_matched_subscriptions", c_int, c_void_p, POINTER(c_size_t))
        assert ask(self._publisher, byref(count)) == 0
        return count.value > 0

    def send(self, data: bytes) -> bool:
        """Send a request; whether it could be: of a type of bounded size one that is longer cannot.

        `data` begins with the four bytes of its encapsulation.
        """
        message = _Bytes(data, len(data), len(data))
        publish = _rmw("rmw_publish_serialized_message", c_int, c_void_p, POINTER(_Bytes), c_void_p)
        return bool(publish(self._publisher, byref(message), None) == 0)

    def close(self) -> None:
        """Let the node be destroyed."""
        destroy = _rmw("rmw_destroy_publisher", c_int, c_void_p, c_void_p)
        assert destroy(self._node, self._publisher) == 0


def services_of(node: Node, name: str, namespace: str) -> dict[str, type]:
    """Services of another node, those of its actions included: the type of the request by full name."""
    return {service: _request(kinds[0]) for service, kinds in node.get_service_names_and_types_by_node(name, namespace)}


def _request(kind: str) -> type:
    package, folder, name = kind.split("/")
    found = getattr(importlib.import_module(f"{package}.{folder}"), name.partition("_")[0])
    if folder == "action":
        found = getattr(found.Impl, f"{name.partition('_')[2]}Service")
    request: type = found.Request
    return request


def nonsense(rng: Random, kind: type) -> bytes:
    """Bytes of a request, as a rule none that can be read: at random, or one with some numbers replaced.

    Their number is one of fours: the middleware sends no others.
    """
    label = b"\0\1\0\0" if rng.random() < 0.9 else rng.randbytes(4)
    if rng.random() < 0.5:
        return label + rng.randbytes(rng.randrange(0, 117, 4))
    data = bytearray(serialize_message(kind())[4:])
    data += rng.randbytes(-len(data) % 4 + rng.randrange(0, 20, 4))
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(0, len(data) + 4, 4)
        data[at : at + 4] = struct.pack("<I", rng.choice([0, 1, 2 ** rng.randrange(8, 32), rng.randrange(2**32)]))
    return label + bytes(data)
