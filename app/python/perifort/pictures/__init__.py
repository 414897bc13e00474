from __future__ import annotations
from typing import Any
def plot_results(results: Any, **options: Any) -> list[Any]:
    return []
