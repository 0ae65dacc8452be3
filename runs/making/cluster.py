"""A Dask cluster as an executor."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

PATIENCE = 5.0
"""Seconds in which a scheduler has to answer."""


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of the Dask scheduler at `address`, as long as this is entered.

    Raises
    ------
    ValueError
        Dask is not installed, the address makes no sense, or nobody answers there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError(f"--dask needs Dask, which is not installed ({error}): pip install 'macs-trajectories[dask]'") from None
    # It would tell at length, on several channels, what is told here in one line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise ValueError(f"no Dask scheduler answers at {address} within {PATIENCE:g} s") from error
    except ValueError as error:
        raise ValueError(f"'{address}' is no address of a Dask scheduler, such as tcp://10.0.0.1:8786: {error}") from error
    try:
        yield client.get_executor(pure=False)
    finally:
        client.close(timeout=PATIENCE)
