#!/usr/bin/env python3
"""The windows of a picture: squares of 64x64 pixels at whose every pixel the truth is traced. The rule of src/math/windows.rs.

    python3 windows.py WIDTH HEIGHT COUNT

Prints the corners as `x,y` between blanks, which is what the attribute `windows` of a picture holds.
"""
import sys

SIDE = 64
STEP = (3242174889, 2447445414)  # the low-discrepancy sequence of Roberts 2018, as shares of 2^32


def first(side, cells, cell):
    """The first pixel of a cell: spread evenly from border to border, a lone one in the middle."""
    return (side - SIDE) // 2 if cells == 1 else cell * (side - SIDE) // (cells - 1)


def spread(width, height, count):
    """The corners (x, y) of the first `count` windows, in the order of the rule."""
    size = (width, height)
    cells = [side // SIDE for side in size]
    if not 0 < count <= cells[0] * cells[1]:
        sys.exit(f"{count} windows of {SIDE}x{SIDE} pixels: a picture of {width}x{height} holds 1 to {cells[0] * cells[1]}")
    taken, corners, index = set(), [], 0
    while len(corners) < count:
        index += 1
        cell = tuple((step * index % 2**32 * n) >> 32 for step, n in zip(STEP, cells))
        if cell not in taken:
            taken.add(cell)
            corners.append(tuple(first(*axis) for axis in zip(size, cells, cell)))
    return corners


def text(corners):
    return " ".join(f"{x},{y}" for x, y in corners)


if __name__ == "__main__":
    print(text(spread(*map(int, sys.argv[1:4]))))
