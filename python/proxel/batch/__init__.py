"""The same to many inputs, each in a process that may crash, hang or run out of memory without the others noticing.

    records = proxel.batch.run("scans", "unwrap", "uv", time_limit=60, memory_limit="4G")
    print(records.counts)                                  # {"converged": 97, "refused": 2, "crashed": 1}

`run` takes a folder, a manifest or a list, the name of a job or a function of your own, and a folder for results. A
line of `results.jsonl` is appended as each item ends; the same call again goes on where the last one ended. With
`engine="ray"` the same `run_item` runs on the nodes of a Ray cluster. docs/scale.md says what that costs and gives.
"""

from ._items import Item, read_items
from ._journal import STATUSES, read_results, write_parquet
from ._run import Progress, Records, run
from ._supervise import Limits, run_item

__all__ = [
    "STATUSES",
    "Item",
    "Limits",
    "Progress",
    "Records",
    "read_items",
    "read_results",
    "run",
    "run_item",
    "write_parquet",
]
