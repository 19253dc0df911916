"""Poses as JSON lines over UDP, for programs that show or use them while they are tracked (docs/live.md)."""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence
from urllib.parse import urlsplit

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.io.errors import OutputError, UsageError
from toolkit.tracking.live_people import LivePose
from toolkit.tracks import STATE_NAMES

SCHEMA = "depthmocap.live/1"


def live_line(frame: int, timestamp: float, latency_ms: float, dropped: int, poses: Sequence[LivePose]) -> str:
    """Return one frame as a line of JSON, without the line break.

    Parameters
    ----------
    frame : number of the frame, from 0
    timestamp : seconds, of the source
    latency_ms : from the arrival of the frame to its poses
    dropped : frames that were left out since the start
    poses : of each person in the frame
    """
    decimals = 4  # of metres and confidences: a tenth of a millimetre, and 0.5 kB less for each person
    people = [
        {
            "id": pose.row.person,
            "state": STATE_NAMES[pose.row.result.state],
            "provisional": pose.provisional,
            "joints": np.round(pose.row.result.joints.astype(np.float64), decimals).tolist(),
            "confidence": np.round(pose.row.result.confidence.astype(np.float64), decimals).tolist(),
        }
        for pose in poses
    ]
    line = {
        "schema": SCHEMA, "frame": frame, "time": round(timestamp, 6), "latency_ms": round(latency_ms, 3),
        "dropped": dropped, "people": people,
    }  # fmt: skip
    return json.dumps(line, separators=(",", ":"), allow_nan=False)


def joint_names_line() -> str:
    """Return the first line of a stream: the schema and the names of the joints in the order of each pose."""
    return json.dumps({"schema": SCHEMA, "joint_names": list(REPORTED)}, separators=(",", ":"))


class UdpStream:
    """Sends lines as datagrams to one address; a consumer that is slow or gone never delays the sender.

    Parameters
    ----------
    url : "udp://HOST:PORT"

    Attributes
    ----------
    lost : lines that the system did not take, because the consumer is gone or its buffer is full

    Raises
    ------
    UsageError
        The address cannot be understood.
    OutputError
        The host is not known.
    """

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        try:
            host, port = parts.hostname, parts.port
        except ValueError:
            host, port = None, None
        if parts.scheme != "udp" or not host or not port or parts.path not in ("", "/"):
            raise UsageError(f"--stream is {url!r}; give udp://HOST:PORT, such as udp://127.0.0.1:9000")
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.connect(address)
        except OSError as error:
            raise OutputError(f"cannot stream to {url}: {error.strerror or error}; check the address") from error
        self.lost = 0

    def send(self, line: str) -> None:
        """Send one line."""
        try:
            self._socket.send(f"{line}\n".encode())
        except OSError:  # full buffer, or no consumer at that port
            self.lost += 1

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()
