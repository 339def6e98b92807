"""Stands in for hidapi in another process: a touch sensor at the end of a socket."""

import os
import select
import socket

ADDRESS = "FRICTUS_FAKE_TOUCH"
ANNOUNCED = 2


def enumerate(vendor_id: int, product_id: int) -> list[dict[str, object]]:
    return [{"path": b"socket", "serial_number": "1", "usage_page": 0xFF00}]


class device:  # noqa: N801 - as hidapi calls it
    def open_path(self, path: bytes) -> None:
        host, port = os.environ[ADDRESS].rsplit(":", 1)
        self._wire = socket.create_connection((host, int(port)), timeout=5.0)

    def send_feature_report(self, data: bytes) -> int:
        self._wire.sendall(bytes([len(data) - 1]) + data[1:])
        return len(data)

    def read(self, max_length: int, timeout_ms: int) -> list[int]:
        ready, _, _ = select.select([self._wire], [], [], 1e-3 * timeout_ms)
        if not ready:
            return []
        self._report = self._exactly(self._exactly(1)[0])
        return [ANNOUNCED]

    def get_feature_report(self, report_num: int, max_length: int) -> list[int]:
        return [report_num, *self._report]

    def close(self) -> None:
        self._wire.close()

    def _exactly(self, n_bytes: int) -> bytes:
        data = b""
        while len(data) < n_bytes:
            piece = self._wire.recv(n_bytes - len(data))
            if not piece:
                raise OSError("the sensor is gone")
            data += piece
        return data
