"""How the sums over points are compiled.

Their inner loops are plain loops that LLVM turns into SIMD code.  This needs ``error_model="numpy"``, without
which every division has a branch for zero.  What is compiled is cached on disk for all processes.  The cache
is a convenience: where it cannot be read or written, functions are compiled as if there were none.  The first
run on a machine waits for compilation: this module's logger names each function at level INFO.

The bits of a result must not depend on what was compiled or loaded before.  Therefore compiled functions are
inlined where compiled code calls them (``forceinline=True``): of several copies of a function, optimized in
several places, a process would take the one that it met first, and they round differently.  And one process
compiles a function while the others wait for it, so that all have the same machine code.

Numba asks only whether the source file of a function has changed.  What the function contains of others, and
how it is compiled, is part of the key here, so that an edit anywhere is an edit.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import logging
import os
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property, wraps
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from numba import njit, types
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment, _rebuild_env
from numba.core.runtime import rtsys
from numba.extending import intrinsic

# Without "ninf" and "nnan": a run that diverges must show it.
_FAST_MATH = {"reassoc", "contract", "nsz", "arcp"}

_LONGEST_WAIT = 120.0  # seconds for another process to compile a function, which may have been stopped
_LOOK_SECONDS = 0.02  # between two looks at whether it has

_log = logging.getLogger(__name__)


class CompiledElsewhereError(Exception):
    """Another process is compiling a function that was called `without_waiting`.

    Parameters
    ----------
    lock : str
        The file that is locked meanwhile.
    """

    def __init__(self, lock: str) -> None:
        super().__init__(lock)
        self._lock = lock

    def wait(self) -> bool:
        """Wait until it has done so; False if that takes too long, or cannot be known.

        Returns
        -------
        bool
        """
        try:
            with open(self._lock, "rb") as file:
                return _taken_in_time(file.fileno())
        except OSError:
            return False


_waiting = True  # for what other processes compile
_locked_functions = 0  # by this process: one, and those that it contains


@contextmanager
def without_waiting() -> Iterator[None]:
    """Do not wait for another process to compile a function; what needs one raises `CompiledElsewhereError`.

    In the middle of a compilation the functions that it contains are waited for nevertheless.
    """
    global _waiting
    _waiting = False
    try:
        yield
    finally:
        _waiting = True


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function with Numba when it is first called, and cache the result on disk.

    Parameters
    ----------
    function : callable
        The function.  Left out, a decorator is returned.
    **options
        Further options of `numba.njit`.

    Returns
    -------
    callable
    """
    if function is None:
        return lambda function: compiled(function, **options)
    dispatcher = njit(
        nogil=True,
        error_model="numpy",
        fastmath=_FAST_MATH,
        forceinline=True,
        no_cfunc_wrapper=True,
        **options,
    )(function)
    try:
        files = _ToleratedCache(function)
    except RuntimeError:
        _say_once("no directory can be written to")
        return dispatcher
    dispatcher._cache = files
    compile_or_load = dispatcher.compile

    @wraps(compile_or_load)
    def one_process_compiles(signature: Any) -> Any:
        try:
            return compile_or_load(signature)
        finally:
            files.unlock()

    dispatcher.compile = one_process_compiles
    return dispatcher


class _Announcer(event.Listener):
    """Logs the name of each function that is compiled because the cache does not have it."""

    def on_start(self, event: Any) -> None:
        _log.info("compiling %s", event.data["dispatcher"].py_func.__name__)

    def on_end(self, event: Any) -> None:
        """Do nothing: the next function is announced, or a result follows."""


event.register("numba:compile", _Announcer())


@cache
def _say_once(reason: str) -> None:
    _log.warning("compiled functions are not kept (%s); they are compiled anew by every process", reason)


class _ToleratedCache(FunctionCache):
    """Numba's cache, none of whose failures matters.

    A look for something that it does not have locks it, until `unlock`: what is missing will be compiled.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._lock: int | None = None
        self._cache_file = _CheckedFiles(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return *super()._index_key(sig, codegen), self._digest_of_contents

    @cached_property
    def _digest_of_contents(self) -> str:
        digest = hashlib.sha256(Path(__file__).read_bytes())
        for part in _contents(self._py_func, set()):
            digest.update(part)
        return digest.hexdigest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._look(sig, target_context)
        if found is None and self._locked():
            found = self._look(sig, target_context)  # another process may have compiled it meanwhile
        return found

    def unlock(self) -> None:
        """Let other processes look, which find what has been saved."""
        global _locked_functions
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
            _locked_functions -= 1

    def _locked(self) -> bool:
        """Wait until no other process compiles this function; False if that cannot be known."""
        global _locked_functions
        if self._lock is not None:
            return False
        try:
            self._impl.locator.ensure_cache_path()
            self._lock = os.open(self._cache_file.lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            _locked_functions += 1
            if _taken(self._lock):
                return True
            if _waiting or _locked_functions > 1:
                return _taken_in_time(self._lock)
        except OSError:
            return False
        raise CompiledElsewhereError(self._cache_file.lock_path)

    def _look(self, sig: Any, target_context: Any) -> Any:
        try:
            # Not by `FunctionCache.load_overload`, which first loads all that Numba can compile.  Only
            # compilation needs that, and does so itself; it takes a third of the start of a run.
            rtsys.initialize(target_context)
            return self._load_overload(sig, target_context)
        except Exception:  # whatever a damaged file leads to; the function is compiled instead
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _say_once(error.strerror or str(error))


def _contents(function: Callable[..., Any], seen: set[Callable[..., Any]]) -> Iterator[bytes]:
    """Yield what decides the machine code of a function: code and constants, its own and of what it calls."""
    if function in seen:
        return
    seen.add(function)
    for code in _codes(function.__code__):
        yield code.co_code
        yield repr([each for each in code.co_consts if not isinstance(each, CodeType)]).encode()
        for name in code.co_names:
            value = function.__globals__.get(name)
            if isinstance(value, Dispatcher):
                yield from _contents(value.py_func, seen)
            elif isinstance(value, FunctionType):  # something else in that file stands for it when compiled
                yield Path(value.__code__.co_filename).read_bytes()
            elif isinstance(value, int | float | str | tuple):
                yield f"{name}={value!r}".encode()


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _taken(lock: int) -> bool:
    """Take a lock, if no other process has it."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _taken_in_time(lock: int) -> bool:
    """Take a lock when no other process has it any more, False if that takes too long."""
    give_up = time.monotonic() + _LONGEST_WAIT
    while not _taken(lock):
        if time.monotonic() > give_up:
            return False
        time.sleep(_LOOK_SECONDS)
    return True


class _CheckedFiles(IndexDataCacheFile):
    """The files of one function's cache.  Machine code is only run if it is what was written."""

    @property
    def lock_path(self) -> str:
        """Where the file lies that is locked while the function is compiled."""
        return self._index_path + ".lock"

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # a torn or empty file; it is written anew
            return {}

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as file:
            digest, data = file.read(32), file.read()
        if hashlib.sha256(data).digest() != digest:
            raise OSError(f"{name} is damaged")
        return _Unpickler(io.BytesIO(data)).load()

    def _save_data(self, name: str, data: Any) -> None:
        pickled = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(pickled).digest() + pickled)


class _Unpickler(pickle.Unpickler):
    """Unpickles compiled code without the modules of Numba that only compilation needs.

    Code refers to an `Environment` of each function in it, with the globals of its module.  Those of Numba's
    own functions are never read, but to import their modules takes a tenth of the start of a run.
    """

    def find_class(self, module_name: str, global_name: str) -> Any:
        if (module_name, global_name) == (Environment.__module__, "_rebuild_env"):
            return _environment
        return super().find_class(module_name, global_name)


def _environment(module_name: str, constants: list[Any], name: str) -> Environment:
    """Return the environment of a function in loaded code."""
    if not module_name.startswith("numba."):
        return _rebuild_env(module_name, constants, name)
    environment = Environment({"__name__": module_name})
    environment.consts[:] = constants
    environment.env_name = name
    return environment


@intrinsic
def widest_vectors(typing_context: Any) -> Any:
    """Let LLVM use 512-bit vectors in the function that calls this, where the processor has them.

    By default LLVM keeps to 256 bits on most processors, because wider ones lower the clock rate.  Sums
    gain a quarter nevertheless.

    Parameters
    ----------
    typing_context : object
        Given by Numba; a call in compiled code has no arguments.

    Returns
    -------
    tuple
        Signature and code generator, as Numba wants them of an intrinsic.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Past the attributes' own `add`, which knows no attributes with values.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate
