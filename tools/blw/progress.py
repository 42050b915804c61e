# SPDX-License-Identifier: MIT
"""Progress on a terminal; nothing in a pipe."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def steps(title: str) -> Iterator[Callable[[str], None]]:
    """A callback that shows the name of the step that begins, on stderr if it is a terminal."""
    with tqdm(desc=title, bar_format="{desc} {postfix} {elapsed}", leave=False,
              disable=None) as bar:
        yield bar.set_postfix_str
