"""Sends a transport stream over UDP on the loopback at its own pace."""

import socket
import threading
import time

import numpy as np

DATAGRAM = 7 * 188


class Transmitter(threading.Thread):
    """Sends `data` to a port in `seconds`; loses datagrams, can be silenced and ended.

    Attributes
    ----------
    silent : threading.Event
        While set, what is due is lost.
    over : threading.Event
        Set it to end.
    """

    def __init__(
        self,
        data: bytes,
        port: int,
        seconds: float,
        *,
        loss: float = 0.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(daemon=True)
        self._loss, self._rng = loss, rng or np.random.default_rng(0)
        self._data, self._port, self._seconds = data, port, seconds
        self.silent = threading.Event()
        self.over = threading.Event()

    def run(self) -> None:
        begin = time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for at in range(0, len(self._data), DATAGRAM):
                due = begin + at / len(self._data) * self._seconds
                if self.over.wait(max(0.0, due - time.monotonic())):
                    return
                if not self.silent.is_set() and self._rng.random() >= self._loss:
                    sender.sendto(self._data[at : at + DATAGRAM], ("127.0.0.1", self._port))
