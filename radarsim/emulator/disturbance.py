"""Network faults of the emulated link: packet loss, duplication, reordering and delay, by rate and seed."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from radarize.io.errors import InputError

#: Smallest and largest number of packets that overtake a reordered or a delayed one. Delayed packets stay within the
#: 1 MiB in which `FrameAssembler` accepts late packets.
REORDERED, DELAYED = (1, 8), (100, 400)


@dataclass
class Disturbance:
    """Lose, duplicate, reorder and delay packets; the same seed affects the same packets.

    Attributes:
        loss, duplicate, reorder, delay: fraction of packets affected, each independently.
        rng: random generator.
        lost, duplicated, reordered, delayed: number of packets so far.

    Raises:
        InputError: a share outside 0...1.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay: float = 0.0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    lost: int = field(default=0, init=False)
    duplicated: int = field(default=0, init=False)
    reordered: int = field(default=0, init=False)
    delayed: int = field(default=0, init=False)

    def __post_init__(self):
        for name in ("loss", "duplicate", "reorder", "delay"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"{name} is {getattr(self, name)}, expected a share of the packets from 0 to 1")
        self._passed = 0
        self._held: list[tuple[int, int, bytes]] = []  # packet count at which it is sent, its own number, packet

    def __call__(self, packet: bytes) -> Iterator[bytes]:
        """Yield the packets to send when `packet` is due."""
        lost, twice, overtaken, late = self.rng.random(4) < (self.loss, self.duplicate, self.reorder, self.delay)
        self._passed += 1
        if lost:
            self.lost += 1
        elif late or overtaken:
            low, high = DELAYED if late else REORDERED
            until = self._passed + int(self.rng.integers(low, high + 1))
            heapq.heappush(self._held, (until, self._passed, packet))
            self.delayed += late
            self.reordered += not late
        else:
            yield packet
        if twice and not lost:
            self.duplicated += 1
            yield packet
        while self._held and self._held[0][0] <= self._passed:
            yield heapq.heappop(self._held)[2]

    def __str__(self) -> str:
        return f"{self.lost} lost, {self.duplicated} twice, {self.reordered} out of order, {self.delayed} delayed"

    def rest(self) -> Iterator[bytes]:
        """Yield the packets still held back at the end."""
        while self._held:
            yield heapq.heappop(self._held)[2]
