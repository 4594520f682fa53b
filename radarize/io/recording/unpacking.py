"""Data sets of which some rows cannot be unpacked: a bad sector, a cut copy, a block that never reached the disk."""

import h5py
import numpy as np
from isal import isal_zlib
from isal.igzip_lib import IsalError
from jaxtyping import Bool, Shaped

#: What h5py and isal raise of damaged chunks.
_UNREADABLE: tuple[type[Exception], ...] = OSError, RuntimeError, ValueError, IsalError  # type: ignore[assignment]
_UNKNOWN, _WHOLE, _DAMAGED = range(3)


class Rows:
    """Rows of a chunked data set; those that cannot be unpacked hold its fill value (samples: zero).

    Args:
        data: of at least one axis.
    """

    def __init__(self, data: h5py.Dataset):
        self.data = data
        self._state = np.zeros(len(data), np.uint8)
        self._one_each = data.chunks is not None and data.chunks[0] == 1
        # Of a chunk that is not in the file, HDF5 gives fill values without a word.
        self._all_there = not self._one_each or data.id.get_num_chunks() >= len(data)
        made = data.id.get_create_plist()
        filters = [made.get_filter(k)[0] for k in range(made.get_nfilters())]
        self._packed = self._one_each and filters == [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE]

    def read(self, start: int, stop: int) -> Shaped[np.ndarray, "row ..."]:
        """Rows start...stop-1, as many as there are."""
        stop = min(stop, len(self.data))
        if self._all_there:
            try:
                rows = self.data[start:stop]
                self._state[start:stop] = _WHOLE
                return rows
            except _UNREADABLE:
                pass
        rows = np.full((max(stop - start, 0), *self.data.shape[1:]), self.data.fillvalue, self.data.dtype)
        for row in range(start, stop):
            if self._there(row):
                try:
                    rows[row - start] = self.data[row]
                    self._state[row] = _WHOLE
                    continue
                except _UNREADABLE:
                    pass
            self._state[row] = _DAMAGED
        return rows

    def whole(self, start: int, stop: int) -> Bool[np.ndarray, "row"]:
        """Which of rows start...stop-1 can be unpacked. Those that nobody has read yet are tried."""
        for row in start + np.flatnonzero(self._state[start:stop] == _UNKNOWN):
            self._state[row] = _WHOLE if self._unpacks(int(row)) else _DAMAGED
        return self._state[start:stop] != _DAMAGED

    def damaged(self) -> Bool[np.ndarray, "row"]:
        """Rows that cannot be unpacked, of those that anybody has read or tried."""
        return self._state == _DAMAGED

    def stored(self, row: int) -> bool:
        """Whether anything of a row is in the file."""
        return not self._one_each or self._there(row)

    def _there(self, row: int) -> bool:
        if self._all_there:
            return True
        try:
            place = (row, *(0 for _ in self.data.shape[1:]))
            return self.data.id.get_chunk_info_by_coord(place).byte_offset is not None
        except _UNREADABLE:
            return False

    def _unpacks(self, row: int) -> bool:
        """Whether a row's chunk can be unpacked; deflate's checksum tells, in half of HDF5's time."""
        if not self._there(row):
            return False
        try:
            if not self._packed:
                self.data[row]
                return True
            _, content = self.data.id.read_direct_chunk((row, *(0 for _ in self.data.shape[1:])))
            return len(isal_zlib.decompress(content)) == self.data.dtype.itemsize * np.prod(self.data.shape[1:])
        except _UNREADABLE:
            return False
