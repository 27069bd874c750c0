"""Compiled kernels: numba is imported when the first of them is called, and compiles once.

`njit` stands for numba's decorator of that name in the modules of kernels. One process of a machine
compiles a kernel; others that need it wait and then load it from the cache. Where only a few
numbers are worked on, `lightly` runs a kernel as Python, without the time (0.5 s) and memory
(90 MB) that importing numba takes.
"""

import contextlib
import fcntl
import gc
import os
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from functools import cache, update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any

_LOCK_NAME = "compiling.lock"
"""File beside the cached code that is locked by the process that compiles."""

_SELDOM = 20_000
"""New objects before a search for garbage while a kernel is compiled: searches took 4 to 9 % of the
time, for numba's own objects stay.
"""

_guard = threading.RLock()


class Settings:
    """How this process compiles.

    Attributes
    ----------
    kept : bool
        Whether compiled code is kept between runs.
    listener : callable
        Takes the number of kernels compiled so far: 0 as the first begins; -1 where this process
        waits for another one.
    count : int
        Kernels that this process compiled.
    """

    kept = True
    listener: Callable[[int], None] = staticmethod(lambda count: None)
    count = 0


class Kernel:
    """A function that is compiled when it is first called.

    Parameters
    ----------
    function : callable
        In the part of Python that numba compiles.
    options : dict
        Of numba's decorator.

    Attributes
    ----------
    py_func : callable
        The function itself.
    light_s : float
        Estimated seconds that it has run as Python.
    """

    def __init__(self, function: FunctionType, options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._dispatcher: Any = None
        self.light_s = 0.0

    def __call__(self, *arguments: Any) -> Any:
        """Run the compiled function."""
        return self.dispatcher()(*arguments)

    def dispatcher(self) -> Any:
        """Return numba's form of the function; its module calls that from now on."""
        if self._dispatcher is not None:
            return self._dispatcher
        with _guard:
            if self._dispatcher is None:
                import numba

                options = {"no_cfunc_wrapper": True} | self._options
                options["no_cpython_wrapper"] = inner = options.pop("inner", False)
                kept = options["cache"] = Settings.kept and options.get("cache", False)
                made: Any = numba.njit(**options)(self.py_func)
                made.get_call_template = _without_literals(made.get_call_template)
                if kept:
                    made._cache = _SharedCache(made._cache)
                if inner:
                    made.__class__ = _inner_kind(made.__class__)
                self._dispatcher = made
                space = self.py_func.__globals__
                for name, value in list(space.items()):
                    if isinstance(value, Kernel):
                        space[name] = value.dispatcher()
        return self._dispatcher


@cache
def _inner_kind(kind: Any) -> Any:
    """Return numba's kind of kernels without a way in from Python: a call would end the process."""
    return type("Inner", (kind,), {"__call__": lambda self, *given: self.py_func(*given)})


def _without_literals(resolve: Callable[..., Any]) -> Callable[..., Any]:
    """Return numba's choice of a form for a call, constants being numbers like others.

    Without this a kernel is compiled once more for each constant that another kernel gives it.
    """
    from numba.core import types

    plain: Any = types.unliteral

    def chosen(args: Iterable[Any], kws: Mapping[str, Any]) -> Any:
        return resolve(tuple(map(plain, args)), {name: plain(one) for name, one in kws.items()})

    return chosen


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return the decorator that makes a `Kernel`; options are those of `numba.njit`.

    Parameters
    ----------
    **options
        ``cache``, ``inline``, ``fastmath``, ``nogil``; ``inner`` for a kernel that only other
        kernels call: it is compiled in an eighth less time without the way in from Python, where it
        is run as Python.

    Returns
    -------
    callable

    Examples
    --------
    >>> double = njit()(lambda x: x + x)
    >>> double.py_func(2)
    4
    """

    def decorate(function: Callable[..., Any]) -> Any:
        assert isinstance(function, FunctionType)
        return Kernel(function, options)

    return decorate


def is_loaded() -> bool:
    """Return whether numba is in this process already."""
    return "numba" in sys.modules


_MOST_LIGHT_S = 0.5
"""Seconds of a kernel run as Python after which importing numba is cheaper."""


def lightly(kernel: Any, work_s: float = 0.0) -> Callable[..., Any]:
    """Return a kernel to be called with little work: without numba where that is not loaded.

    Parameters
    ----------
    kernel : Kernel or a numba dispatcher
    work_s : float
        Estimated seconds of this call as Python: once they add up to the time that importing numba
        takes, the kernel is compiled.

    Returns
    -------
    callable

    Examples
    --------
    >>> lightly(njit()(lambda x: x + x))(2)
    4
    """
    if is_loaded() or not isinstance(kernel, Kernel) or kernel.light_s > _MOST_LIGHT_S:
        return kernel  # type: ignore[no-any-return]
    kernel.light_s += work_s
    return _interpreted(kernel.py_func)


@cache
def _interpreted(function: FunctionType) -> FunctionType:
    """Return a function whose calls of other kernels of its module are not compiled either."""
    space = dict(function.__globals__)
    for name, value in function.__globals__.items():
        if isinstance(value, Kernel):
            one = value.py_func
            space[name] = FunctionType(one.__code__, space, name, one.__defaults__)
    return FunctionType(function.__code__, space, function.__name__, function.__defaults__)


class _SharedCache:
    """The cached machine code of one kernel; one process at a time compiles missing code."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner
        self._turn = _turn_of(str(inner.cache_path))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def load_overload(self, signature: Any, context: Any) -> Any:
        found = self._inner.load_overload(signature, context)
        if found is not None:
            return found
        self._turn.take()
        found = self._inner.load_overload(signature, context)
        if found is not None:
            self._turn.leave()
        else:
            Settings.listener(Settings.count)
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        Settings.count += 1
        try:
            self._inner.save_overload(signature, data)
        finally:
            self._turn.leave()


class _Turn:
    """The turn of this process to compile into a folder."""

    def __init__(self, folder: str) -> None:
        self._path = Path(folder) / _LOCK_NAME
        self._depth = 0
        self._file: int | None = None
        self._threshold = gc.get_threshold()

    def take(self) -> None:
        """Wait until no other process compiles; a kernel may need another one meanwhile."""
        self._depth += 1
        if self._depth > 1:
            return
        self._threshold = gc.get_threshold()
        gc.set_threshold(max(_SELDOM, self._threshold[0]), *self._threshold[1:])
        with contextlib.suppress(OSError):  # without locks each process compiles for itself
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                Settings.listener(-1)
                fcntl.flock(self._file, fcntl.LOCK_EX)

    def leave(self) -> None:
        """Let the next process compile."""
        self._depth -= 1
        if self._depth > 0:
            return
        gc.set_threshold(*self._threshold)
        if self._file is not None:
            os.close(self._file)
            self._file = None


@cache
def _turn_of(folder: str) -> _Turn:
    return _Turn(folder)
