"""Files that were damaged."""

import numpy as np


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """A file's content with some of it changed, lost, repeated, swapped or added."""
    content, n = bytearray(whole), len(whole)
    start, length = int(rng.integers(n)), int(rng.integers(1, min(n, 5000)))
    match int(rng.integers(6)):
        case 0:
            content[start] ^= int(rng.integers(1, 256))
        case 1:
            del content[start:]
        case 2:
            content[start : start + length] = bytes(len(content[start : start + length]))
        case 3:
            content[start:start] = content[start : start + length]
        case 4:
            other = int(rng.integers(n))
            (first, second), length = sorted((start, other)), min(length, abs(start - other), n - max(start, other))
            content[first : first + length], content[second : second + length] = (
                content[second : second + length],
                content[first : first + length],
            )
        case 5:
            content += rng.bytes(length)
    return bytes(content)
