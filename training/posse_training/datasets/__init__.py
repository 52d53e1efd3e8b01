"""Data sets for offline learning, in Minari's format; needs the extra ``datasets``."""

from __future__ import annotations

from posse_training.errors import require

require("datasets", "minari", "h5py")

from posse_training.datasets.record import load_dataset, record_dataset  # noqa: E402

__all__ = ["load_dataset", "record_dataset"]
