"""Poses over UDP as JSON lines or OSC bundles, for programs that show or use them live (docs/live.md)."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol
from urllib.parse import urlsplit

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.io.errors import OutputError, UsageError, optional_package, os_errors_as
from toolkit.tracking.live_people import LivePose
from toolkit.tracks import STATE_NAMES

SCHEMA = "depthmocap.live/1"


class LiveUpdate(NamedTuple):
    """A tracked frame of a live source.

    Attributes
    ----------
    frame : number of the frame, from 0
    timestamp : seconds, of the source
    latency_ms : from the arrival of the frame to its poses
    dropped : frames that were left out since the start
    poses : poses of each person in the frame
    depth_mm : uint16 (H, W), millimetres, the frame itself
    """

    frame: int
    timestamp: float
    latency_ms: float
    dropped: int
    poses: Sequence[LivePose]
    depth_mm: np.ndarray


class LiveOutput(Protocol):
    """A consumer of the poses of each frame."""

    def send(self, update: LiveUpdate) -> None:
        """Take a tracked frame; it must not wait."""
        ...


def live_line(update: LiveUpdate) -> str:
    """Return a tracked frame as a line of JSON, without the line break."""
    decimals = 4  # of metres and confidences: a tenth of a millimetre, and 0.5 kB less for each person
    people = [
        {
            "id": pose.row.person,
            "state": STATE_NAMES[pose.row.result.state],
            "provisional": pose.provisional,
            "joints": np.round(pose.row.result.joints.astype(np.float64), decimals).tolist(),
            "confidence": np.round(pose.row.result.confidence.astype(np.float64), decimals).tolist(),
        }
        for pose in update.poses
    ]
    line = {
        "schema": SCHEMA, "frame": update.frame, "time": round(update.timestamp, 6),
        "latency_ms": round(update.latency_ms, 3), "dropped": update.dropped, "people": people,
    }  # fmt: skip
    return json.dumps(line, separators=(",", ":"), allow_nan=False)


def joint_names_line() -> str:
    """Return the first line of a stream: the schema and the names of the joints in the order of each pose."""
    return json.dumps({"schema": SCHEMA, "joint_names": list(REPORTED)}, separators=(",", ":"))


class PoseStream:
    """Datagrams to one address; a consumer that is slow or gone never delays the sender.

    A stream of lines begins with the names of the joints.

    Parameters
    ----------
    url : "udp://HOST:PORT" for lines of JSON, "osc://HOST:PORT" for bundles of Open Sound Control

    Attributes
    ----------
    lost : datagrams that the system did not take, because the consumer is gone or its buffer is full

    Raises
    ------
    UsageError
        The address cannot be understood, or the package python-osc is not installed.
    OutputError
        The host is not known.
    """

    def __init__(self, url: str) -> None:
        host, port = _address(url)
        lines = urlsplit(url).scheme == "udp"
        self._pack = (lambda update: f"{live_line(update)}\n".encode()) if lines else _osc_packer()
        with os_errors_as(OutputError, f"cannot stream to {url}", "check the address"):
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.connect(address)
        self.lost = 0
        if lines:
            self._send_bytes(f"{joint_names_line()}\n".encode())

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()

    def send(self, update: LiveUpdate) -> None:
        """See `LiveOutput.send`."""
        self._send_bytes(self._pack(update))

    def _send_bytes(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
        except OSError:  # full buffer, or no consumer at that port
            self.lost += 1


def _osc_packer() -> Callable[[LiveUpdate], bytes]:
    """Return the function that makes a bundle of Open Sound Control of a frame."""
    bundles = optional_package("pythonosc.osc_bundle_builder", "osc", "OSC")
    messages = optional_package("pythonosc.osc_message_builder", "osc", "OSC")

    def packed(update: LiveUpdate) -> bytes:
        bundle = bundles.OscBundleBuilder(bundles.IMMEDIATELY)

        def add(address: str, types: str, *values: object) -> None:
            message = messages.OscMessageBuilder(address)
            for kind, value in zip(types, values, strict=True):
                message.add_arg(value, kind)
            bundle.add_content(message.build())

        add("/depthmocap/frame", "idi", update.frame, update.timestamp, update.dropped)
        for pose in update.poses:
            found, person = pose.row.result, f"/depthmocap/person/{pose.row.person}"
            add(f"{person}/state", "si", STATE_NAMES[found.state], int(pose.provisional))
            for name, place, confidence in zip(REPORTED, found.joints.tolist(), found.confidence.tolist(), strict=True):
                add(f"{person}/{name}", "ffff", *place, confidence)
        return bytes(bundle.build().dgram)

    return packed


def _address(url: str) -> tuple[str, int]:
    """Return host and port of a URL."""
    parts = urlsplit(url)
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if parts.scheme not in ("udp", "osc") or not host or not port or parts.path not in ("", "/"):
        raise UsageError(f"--stream is {url!r}; give udp://HOST:PORT or osc://HOST:PORT, such as udp://127.0.0.1:9000")
    return host, port
