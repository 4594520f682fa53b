"""The beat signal as a direct sum over echoes, exact and plain: what a GPU is for.

`Synthesizer` computes the same numbers from the same inputs, faster on a CPU. Here the sum is taken as it stands, but
for one step: sample n = q i + j, so a tone is a product of two short ones,

    exp(j w t_n) = exp(j w t_(q i)) exp(j w j / f_s),  and  s[i, j] = sum_e (A_e exp(j phase_e) row_e[i]) column_e[j]

is a batched matrix product over the echoes, one per frame, loop and channel: 2 sqrt(N) exponentials an echo and trace
instead of N, and the rest is what tensor cores do. On a CPU everything is float64; on CUDA phases are reduced to one
turn in float64 and the products are complex64. CUDA has not been measured: no GPU was at hand.
"""

import numpy as np
import torch
from jaxtyping import Complex, Float

from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.physics.synthesis import BurstClock

#: Bytes of intermediate results at a time: 8 frames of 6,000 echoes go in 4 pieces.
BLOCK_BYTES = 1 << 30


class DirectSum:
    """Sums bursts, several frames at a time.

    Args:
        config: radar configuration.
        device: torch device.
        block_bytes: memory for intermediate results; smaller blocks give the same numbers.
    """

    def __init__(self, config: RadarConfig, device: str = "cpu", block_bytes: int = BLOCK_BYTES):
        self.config, self.device, self.block_bytes = config, torch.device(device), block_bytes
        self.real, self.complex = (
            (torch.float64, torch.complex128) if self.device.type == "cpu" else (torch.float32, torch.complex64)
        )
        clock = BurstClock.of(config)
        self._half = clock.half
        self._s = self._tensor((config.chirp_times - clock.middle) / clock.half)
        self._columns = int(np.ceil(np.sqrt(config.samples)))
        self._rows = -(-config.samples // self._columns)
        start = -(config.samples - 1) / 2
        self._row_time = self._tensor((start + self._columns * np.arange(self._rows)) / config.sample_rate)
        self._column_time = self._tensor(np.arange(self._columns) / config.sample_rate)

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(values, dtype=torch.float64, device=self.device)

    def __call__(
        self, lengths: Float[np.ndarray, "echo virtual 3"], amplitudes: Complex[np.ndarray, "echo"]
    ) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Beat signal of one burst; arguments as for `Synthesizer.__call__`."""
        return self.batch([lengths], [amplitudes])[0]

    def batch(
        self, lengths: list[Float[np.ndarray, "echo virtual 3"]], amplitudes: list[Complex[np.ndarray, "echo"]]
    ) -> Complex[np.ndarray, "frame loop tx rx sample"]:
        """Beat signals of several bursts."""
        loops, tx, rx, samples, _ = self.config.frame_shape
        out = np.zeros((len(lengths), loops, tx, rx, samples), np.complex64 if self.real == torch.float32 else complex)
        most = max((len(a) for a in amplitudes), default=0)
        if not most:
            return out
        per_loop = most * tx * rx * (self._rows + self._columns) * 2 * self.complex.itemsize
        frames = int(np.clip(self.block_bytes // (per_loop * loops), 1, len(lengths)))
        step = int(np.clip(self.block_bytes // (per_loop * frames), 1, loops))
        for first in range(0, len(lengths), frames):
            c, a = self._padded(lengths[first : first + frames], amplitudes[first : first + frames])
            for loop in range(0, loops, step):
                block = self._block(c, a, self._s[loop : loop + step])
                out[first : first + frames, loop : loop + step] = block.cpu().numpy()
        return out

    def _padded(self, lengths: list[np.ndarray], amplitudes: list[np.ndarray]) -> tuple[torch.Tensor, torch.Tensor]:
        """Frames of different numbers of echoes as one tensor: (frame, tx, rx, echo, 3) and (frame, echo)."""
        _, tx, rx, _, _ = self.config.frame_shape
        most = max(len(a) for a in amplitudes)
        c = torch.zeros((len(lengths), tx, rx, most, 3), dtype=torch.float64, device=self.device)
        a = torch.zeros((len(lengths), most), dtype=torch.complex128, device=self.device)
        for k, (length, amplitude) in enumerate(zip(lengths, amplitudes, strict=True)):
            n = len(amplitude)
            c[k, :, :, :n] = self._tensor(length).reshape(n, tx, rx, 3).permute(1, 2, 0, 3)
            a[k, :n] = torch.as_tensor(amplitude, dtype=torch.complex128, device=self.device)
        return c, a

    def _block(self, c: torch.Tensor, a: torch.Tensor, s: torch.Tensor) -> torch.Tensor:
        """Signal of some loops, whose instants are s (loop, tx), of all frames: (frame, loop, tx, rx, sample)."""
        config = self.config
        c, s = c[:, None], s[None, :, :, None, None]  # frame, loop, tx, rx, echo
        length = c[..., 0] + s * (c[..., 1] + s * c[..., 2])
        rate = (c[..., 1] + 2 * s * c[..., 2]) / self._half
        beat = (config.slope * length + config.center_frequency * rate) / SPEED_OF_LIGHT
        turns = config.center_frequency / SPEED_OF_LIGHT * length
        rows = self._unit(turns[..., None, :] + beat[..., None, :] * self._row_time[:, None])
        rows = rows * a.to(self.complex)[:, None, None, None, None]
        columns = self._unit(beat[..., None] * self._column_time)
        product = rows @ columns  # (..., row, echo) x (..., echo, column)
        return product.flatten(-2)[..., : config.samples]

    def _unit(self, turns: torch.Tensor) -> torch.Tensor:
        angle = (2 * torch.pi * (turns - turns.round())).to(self.real)
        return torch.polar(torch.ones_like(angle), angle)
