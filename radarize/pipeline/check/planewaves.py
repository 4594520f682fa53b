"""How well echoes fit plane waves over an array, for a supposed assignment of antennas."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Complex, Complex64, Float

from radarize.radar.array import layout
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig
from radarize.signal.snapshots import Snapshots

#: Rounds in which the phases of the channels are estimated, and minimum purity of the cells used.
_ROUNDS, _PURE = 2, 0.7


@dataclass(frozen=True, eq=False)
class Reading:
    """Supposed antennas of the channels.

    Attributes:
        places: (left, up) of the virtual antennas, half wavelengths.
        sign: signs of the channels, of magnitude 1.
        delay: s, from a loop's start to each transmitter's chirp.
        wavelength: m.
        spacing: ratio of half wavelengths at the design frequency to those of the signal.
    """

    places: Float[np.ndarray, "tx rx 2"]
    sign: Complex[np.ndarray, "tx rx"]
    delay: Float[np.ndarray, "tx"]
    wavelength: float
    spacing: float = 1.0

    @classmethod
    def of(
        cls, config: RadarConfig, tx: tuple[int, ...] = (), rx: tuple[int, ...] = (), moved: bool = False
    ) -> "Reading":
        """Return the antennas of a configuration, with some exchanged.

        Args:
            tx: index of the transmitter at each place of the axis; empty: as configured.
            rx: the same for receivers.
            moved: the times of chirps were exchanged with the transmitters; else the firing order differs.
        """
        out, back = layout(config)
        tx, rx = tx or tuple(range(len(config.tx))), rx or tuple(range(len(config.rx)))
        out, back = out[list(tx)], back[list(rx)]
        factors = config.calibration[np.ix_(tx, rx)]
        slots = np.asarray(config.slot)[list(tx)] if moved else np.asarray(config.slot)
        spacing = config.center_frequency / load_board(config.board).design_frequency
        return cls(
            out[:, None] + back[None], factors / np.abs(factors), slots * config.chirp_time, config.wavelength, spacing
        )


@dataclass(frozen=True, eq=False)
class PlaneWaves:
    """Echoes as plane waves over an array.

    Attributes:
        purity: share of a cell's power that one plane wave explains, 0 to 1.
        direction: direction cosines of the waves to the left and up.
        phases: rad, mean phase errors of the channels, already subtracted.
    """

    purity: Float[np.ndarray, "cell"]
    direction: Float[np.ndarray, "cell 2"]
    phases: Float[np.ndarray, "tx rx"]


@cache
def _directions() -> Float[np.ndarray, "beam 2"]:
    left, up = np.meshgrid(np.linspace(-0.94, 0.94, 48), np.linspace(-0.72, 0.72, 13), indexing="ij")
    grid = np.stack([left, up], axis=-1).reshape(-1, 2)
    return grid[np.square(grid).sum(axis=1) < 1]


def fit_plane_waves(cells: Snapshots, reading: Reading) -> PlaneWaves:
    """Fit a plane wave to each cell, and one phase to each channel."""
    turn = np.exp(4j * np.pi / reading.wavelength * cells.speed[:, None] * reading.delay)[:, :, None]
    waves = (cells.channels * (turn * reading.sign)).reshape(len(cells.speed), -1).astype(np.complex64)
    power = np.maximum(np.square(np.abs(waves)).sum(axis=1), 1e-30)
    beams, places = _directions(), reading.places.reshape(-1, 2) * reading.spacing
    flat = not np.ptp(places[:, 1])
    if flat:
        beams = beams[np.isclose(beams[:, 1], 0)]
    steering = np.exp(-1j * np.pi * places @ beams.T).astype(np.complex64)
    phases: Complex64[np.ndarray, "channel"] = np.ones(waves.shape[1], np.complex64)
    for step in range(_ROUNDS + 1):
        seen = np.square(np.abs((waves * phases.conj()) @ steering.conj()))
        best = seen.argmax(axis=1)
        purity = seen[np.arange(len(seen)), best] / power / waves.shape[1]
        if step == _ROUNDS or (pure := purity > _PURE).sum() < 10:
            break
        expected = steering[:, best[pure]].T
        turned = waves[pure] * phases.conj() * expected.conj()
        turned *= (turned.sum(axis=1, keepdims=True).conj()) / power[pure, None]
        correction = turned.sum(axis=0)
        phases = phases * correction / np.maximum(np.abs(correction), 1e-30)
    return PlaneWaves(purity, beams[best], np.angle(phases).reshape(reading.sign.shape))
