"""Data sets with rows that cannot be unpacked, due to a bad sector, a truncated copy, or a block that was not
written."""

import h5py
import numpy as np
from isal import isal_zlib
from isal.igzip_lib import IsalError
from jaxtyping import Bool, Shaped

#: Errors that h5py and isal raise for damaged chunks.
_UNREADABLE: tuple[type[Exception], ...] = OSError, RuntimeError, ValueError, IsalError  # type: ignore[assignment]
_UNKNOWN, _WHOLE, _DAMAGED = range(3)


class Rows:
    """Rows of a chunked data set; those that cannot be unpacked have the fill value (samples: zero).

    Args:
        data: data set with at least one axis.
    """

    def __init__(self, data: h5py.Dataset):
        self.data = data
        self._state = np.zeros(len(data), np.uint8)
        self._one_each = data.chunks is not None and data.chunks[0] == 1
        # HDF5 silently returns fill values for a chunk that is missing in the file.
        self._all_there = not self._one_each or data.id.get_num_chunks() >= len(data)
        made = data.id.get_create_plist()
        filters = [made.get_filter(k)[0] for k in range(made.get_nfilters())]
        self._packed = self._one_each and filters == [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE]

    def read(self, start: int, stop: int) -> Shaped[np.ndarray, "row ..."]:
        """Read rows start to stop - 1, as far as there are any."""
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
        """Return which of rows start to stop - 1 can be unpacked. Rows that were not read yet are tried."""
        for row in start + np.flatnonzero(self._state[start:stop] == _UNKNOWN):
            self._state[row] = _WHOLE if self._unpacks(int(row)) else _DAMAGED
        return self._state[start:stop] != _DAMAGED

    def damaged(self) -> Bool[np.ndarray, "row"]:
        """Return which rows cannot be unpacked, out of those read or tried so far."""
        return self._state == _DAMAGED

    def stored(self, row: int) -> bool:
        """Return whether the file has any data of a row."""
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
        """Return whether a row's chunk can be unpacked; deflate's checksum is tested, which takes half of HDF5's
        time."""
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
