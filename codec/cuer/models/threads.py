"""One thread for many small matrices.

The models' matrices have tens of rows. Libraries of linear algebra share even these among all
cores; the threads then wait for each other, beside other work for several times as long as one
thread takes alone.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _controller() -> Any:
    import scipy.linalg  # noqa: F401  (its own BLAS has to be loaded before the controller looks)
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` with the linear algebra in it kept to the thread that calls it.

    The limit holds for the process while the function runs; the user's setting comes back.

    Examples
    --------
    >>> one_thread(max)(1, 2)
    2
    """

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with _controller().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return alone
