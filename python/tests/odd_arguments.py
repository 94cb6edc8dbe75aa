"""Odd arguments: what a program may pass by mistake, about a thousand objects."""

from __future__ import annotations

import array
import collections
import datetime
import decimal
import enum
import fractions
import io
import itertools
import pathlib
import sys
import types
from typing import Any, Callable, Iterator

import numpy as np

DTYPES: list[Any] = [
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float16", "float32", "float64", "longdouble", "complex64", "complex128"),
    *("object", "S3", "U3", "V4", "V0", "M8[s]", "m8[s]", ">f4", ">u2", ">i8"),
    [("x", "f4"), ("y", "u4")],
    [("position", "f4", (3,)), ("x", "V4")],
    [("x", [("y", ">f8")])],
    {"names": ["x", "y"], "formats": ["f4", "f4"], "offsets": [0, 0]},
    {"names": ["x"], "formats": ["u1"], "offsets": [3], "itemsize": 64},
    ("f4", (2, 2)),
]
SHAPES: list[tuple[int, ...]] = [(), (0,), (1,), (3,), (4, 3), (3, 4), (2, 2, 4), (1, 1, 1, 4), (0, 3)]


class Raises(Exception):
    """What odd objects raise themselves."""


class RaisesEverywhere:
    """An object whose every method raises an exception."""

    def _raise(self, *_: Any) -> Any:
        raise Raises

    __len__ = __iter__ = __getitem__ = __float__ = __int__ = __index__ = __bool__ = __array__ = _raise
    __fspath__ = __str__ = __repr__ = __eq__ = __hash__ = __getattr__ = __contains__ = _raise


class Lies:
    """An object whose methods return something else than they should."""

    __array_interface__ = 5
    dtype = "float32"
    shape = "(3,)"
    ndim = -1
    typecode = "f"

    def __array__(self, *_: Any, **__: Any) -> Any:
        return [1, 2, 3]

    def __len__(self) -> int:
        return 2**40

    def __getitem__(self, _: Any) -> Any:
        return self

    def __index__(self) -> int:
        return 2**70


class NegativeInteger(int):
    """A subclass of int."""


class Colour(enum.IntEnum):
    """Integers with names."""

    RED = 1


class ListOfItself(list):  # type: ignore[type-arg]
    """A list that grows while it is read."""

    def __iter__(self) -> Iterator[Any]:
        for at in range(100):
            self.append(at)
            yield at


def deep(make: Callable[[Any], Any], depth: int) -> Any:
    value: Any = 1
    for _ in range(depth):
        value = make(value)
    return value


def scalars() -> list[Any]:
    numbers: list[Any] = [0, 1, -1, 2, 255, 256, 2**31, 2**32 - 1, 2**32, 2**63, 2**64, -(2**63), 10**400]
    numbers += [0.5, -0.0, 1e300, 1e-320, float("nan"), float("inf"), -float("inf"), 1j, True, False, None]
    numbers += [NegativeInteger(-7), Colour.RED, decimal.Decimal("1.5"), decimal.Decimal("NaN")]
    numbers += [fractions.Fraction(1, 3), datetime.date(2020, 1, 1), datetime.timedelta(1), ...]
    for kind in ("float16", "float32", "float64", "longdouble", "int8", "uint32", "int64", "bool", "complex64"):
        numbers.append(np.dtype(kind).type(1))
    numbers += [np.float32("nan"), np.int64(-1), np.uint64(2**64 - 1), np.datetime64("2020"), np.bytes_(b"a")]
    return numbers


def texts() -> list[Any]:
    found: list[Any] = ["", "a", "main", "\0", "a\0b", "\ud800", "𝛼" * 300, "../..", "x.wgsl", "{}", "%s", "1", "nan"]
    found += [b"", b"abc", b"\x03\x02\x23\x07" * 9, bytearray(b"abcd"), memoryview(b"abcdefgh")]
    found += [memoryview(b"abcdefgh")[::2], memoryview(array.array("f", [1, 2])), pathlib.Path("nowhere")]
    found += [pathlib.PurePosixPath("a\0"), np.str_("main"), io.BytesIO(b"abc"), io.StringIO("abc")]
    return found


def containers() -> list[Any]:
    itself: list[Any] = []
    itself.append(itself)
    dict_itself: dict[str, Any] = {}
    dict_itself["x"] = dict_itself
    found: list[Any] = [[], [[]], [1], [1, 2], [1, 2, 3], [1, 2, 3, 4], [1, "2", 3], [1, None, 3], [1, [2], 3]]
    found += [[[1, 2, 3], [4, 5]], [[1, 2, 3]] * 2, [[[1, 2, 3]] * 3], [float("nan")] * 3, [-1] * 3, [2**70] * 3]
    found += [[{}], [{"x": 1}], [{"x": 1}, 2], [b"abc"], [np.zeros(3)], [np.float32(1)] * 3, [itself], itself]
    found += [deep(lambda one: [one], 31), deep(lambda one: [one], 33), deep(lambda one: (one,), 20_000)]
    found += [{}, {"": 1}, {1: 2}, {None: None}, {"x": {"y": 1}}, {"payload": 1}, {"t": "a"}, {"\ud800": 1}]
    found += [{(0, 0): b"abcd"}, {(0,): 1}, {(0, -1): 1}, {"a": [1] * 100}, dict_itself, collections.UserDict(x=1)]
    found += [deep(lambda one: {"x": one}, 5_000), collections.OrderedDict(x=1), types.MappingProxyType({"x": 1})]
    found += [(), (1,), (0, 0), (1, 2, 3), ("a", "b"), (0, 2**40), set(), {1, 2}, frozenset("ab"), range(3), range(0)]
    found += [range(10**12), collections.deque([1, 2, 3]), array.array("f", [1, 2, 3]), array.array("i"), ListOfItself()]
    found += [itertools.count(), itertools.repeat("x"), itertools.repeat(0)]
    found += [iter([1, 2, 3]), (one for one in "abc"), map(int, "123"), zip("ab", "cd"), {"x": 1}.items()]
    return found


def objects() -> list[Any]:
    found: list[Any] = [object(), object, int, type, len, print, lambda *_: None, sys, Raises, NotImplemented]
    found += [RaisesEverywhere(), Lies(), RaisesEverywhere, Lies, Exception("x"), slice(1, 2), np, np.float32]
    found += [np.dtype("f4"), np.dtype([("x", "f4")]), np.random.default_rng(1), np.nditer(np.zeros(2))]
    found += [np.zeros(2).flat, np.ma.masked, np.ma.masked_array([1.0, 2.0], [True, False]), np.matrix([[1, 2, 3]])]
    found += [np.zeros(2, [("x", "f4")]).view(np.recarray), np.poly1d([1, 2]), np.broadcast(1, 2)]
    return found


def arrays() -> list[Any]:
    found: list[Any] = []
    for dtype in DTYPES:
        for shape in SHAPES:
            whole: Any = np.zeros(shape, dtype)
            found.append(whole)
            if whole.ndim and whole.size:
                # Other strides: backwards, with gaps, of Fortran, none at all.
                read_only = whole.copy()
                read_only.flags.writeable = False
                found += [whole[::-1], np.repeat(whole, 2, axis=0)[::2], read_only]
                found += [np.asfortranarray(whole)] if whole.ndim > 1 else [np.broadcast_to(whole[0], whole.shape)]
    extremes: list[Any] = [np.nan, np.inf, -np.inf, 3.4e38, 1e-45, -1]
    found += [np.full(shape, one, np.float32) for one in extremes for shape in [(3,), (4, 3), (2, 2, 4)]]
    unaligned: Any = np.zeros(17, np.uint8)[1:].view(np.float32)
    return [*found, unaligned, np.full(3, 2**32 - 1, np.uint32), np.full((1, 3), -1, np.int32)]


def odd_arguments() -> list[Any]:
    """All of them, in an order that stays."""
    return [*scalars(), *texts(), *containers(), *objects(), *arrays()]
