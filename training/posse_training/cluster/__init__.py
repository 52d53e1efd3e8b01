"""Evaluations, recordings, tuning and training on a Ray cluster; Ray needs the extra ``cluster``.

Work is cut into shards by the index of its worlds (``shards``), whose results are kept on disk
(``store``) and collected whatever fails (``collect``). None of these knows Ray: ``ray_backend``
does.
"""

from __future__ import annotations

from posse_training.cluster.settings import Cluster

__all__ = ["Cluster"]
